/// Who may use the service, and how much of it.
///
///     tokens  = *line
///     line    = [ name 1*SP digest ] [ "#" comment ] LF
///     name    = 1*64( letter / digit / "-" / "_" / "." )     whose jobs they are; each once
///     digest  = 64 hexadecimal digits                        SHA-256 of the token
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace radbake::server {

/// Bearer tokens, of which only digests are known. They are to be long and random: a digest hides no word.
class Tokens {
 public:
  /// Throws std::runtime_error that names the file and the line.
  static Tokens Read(const std::filesystem::path& file);
  /// Throws std::runtime_error that names the line.
  explicit Tokens(std::string_view text);

  /// Whose token an Authorization header carries; nothing if nobody's. Takes the same time for all.
  std::optional<std::string> Owner(std::string_view authorization) const;

 private:
  struct Entry {
    std::string owner;
    std::string digest;
  };
  std::vector<Entry> entries_;
};

/// At most so many a minute of each owner: so many at once, then evenly. Thread-safe.
class Rate {
 public:
  using Clock = std::chrono::steady_clock;

  /// 0: as many as they like.
  explicit Rate(int a_minute) : a_minute_(a_minute) {}
  /// Takes one. Nothing if there was one; else in how many seconds there will be.
  std::optional<std::chrono::seconds> Take(const std::string& owner, Clock::time_point now);

 private:
  struct Bucket {
    double left = 0;
    Clock::time_point when;
  };
  int a_minute_;
  std::mutex mutex_;
  std::map<std::string, Bucket> buckets_;
};

}  // namespace radbake::server
