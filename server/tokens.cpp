#include "server/tokens.h"

#include <openssl/crypto.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "server/digest.h"

namespace radbake::server {
namespace {

constexpr std::size_t kDigest = 64;
constexpr std::size_t kLongestName = 64;

bool IsName(std::string_view text) {
  constexpr std::string_view kTaken = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  return !text.empty() && text.size() <= kLongestName &&
         text.find_first_not_of(kTaken) == std::string_view::npos;
}

bool IsDigest(std::string_view text) {
  return text.size() == kDigest && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

}  // namespace

Tokens Tokens::Read(const std::filesystem::path& file) {
  std::ostringstream text;
  const std::ifstream stream(file);
  text << stream.rdbuf();
  if (!stream.is_open() || !text) {
    throw std::runtime_error("the tokens in " + file.string() + " cannot be read, or there is none");
  }
  try {
    return Tokens(text.str());
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

Tokens::Tokens(std::string_view text) {
  std::istringstream lines{std::string(text)};
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream words(line.substr(0, line.find('#')));
    Entry entry;
    std::string more;
    if (!(words >> entry.owner)) {
      continue;
    }
    words >> entry.digest;
    const auto same = [&](const Entry& other) { return other.owner == entry.owner; };
    if (!IsName(entry.owner) || !IsDigest(entry.digest) || words >> more ||
        std::any_of(entries_.begin(), entries_.end(), same)) {
      throw std::runtime_error("line " + std::to_string(number) +
                               " is not a new name and the SHA-256 of its token in 64 hexadecimal digits");
    }
    entries_.push_back(entry);
  }
  if (entries_.empty()) {
    throw std::runtime_error("there is no token");
  }
}

std::optional<std::string> Tokens::Owner(std::string_view authorization) const {
  constexpr std::string_view kScheme = "Bearer ";
  if (!authorization.starts_with(kScheme)) {
    return std::nullopt;
  }
  const std::string digest = Sha256Hex(authorization.substr(kScheme.size()));
  const Entry* found = nullptr;
  for (const Entry& entry : entries_) {
    found = CRYPTO_memcmp(entry.digest.data(), digest.data(), kDigest) == 0 ? &entry : found;
  }
  return found == nullptr ? std::nullopt : std::optional(found->owner);
}

std::optional<std::chrono::seconds> Rate::Take(const std::string& owner, Clock::time_point now) {
  if (a_minute_ == 0) {
    return std::nullopt;
  }
  const double a_second = a_minute_ / 60.0;
  const std::lock_guard lock(mutex_);
  const auto [found, fresh] = buckets_.try_emplace(owner, Bucket{static_cast<double>(a_minute_), now});
  Bucket& bucket = found->second;
  const double passed = std::chrono::duration<double>(now - bucket.when).count();
  bucket.left = std::min<double>(a_minute_, bucket.left + passed * a_second);
  bucket.when = now;
  if (bucket.left < 1) {
    constexpr double kRounding = 1e-6;
    const double seconds = std::ceil((1 - bucket.left) / a_second - kRounding);
    return std::chrono::seconds(std::max<std::int64_t>(1, std::llround(seconds)));
  }
  bucket.left -= 1;
  return std::nullopt;
}

}  // namespace radbake::server
