/// multipart/form-data (RFC 7578), read as it streams by: never more than a part's header is held.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace radbake::server {

/// The boundary that a Content-Type header names; empty if it is not multipart/form-data or names none that
/// fits.
std::string MultipartBoundary(std::string_view content_type);

class MultipartParser {
 public:
  struct Part {
    std::string name;
    std::string filename;  ///< empty: none
  };
  struct Events {
    std::function<void(const Part&)> begin;
    std::function<void(std::string_view)> data;
    std::function<void()> end;
  };

  MultipartParser(const std::string& boundary, Events events);

  /// The next bytes of the body. Throws ProblemError (400) for what is not multipart/form-data, and whatever
  /// the events throw.
  void Feed(std::string_view bytes);
  /// The body has ended. Throws ProblemError (400) if its last part has not.
  void End();

 private:
  enum class State { kPreamble, kDelimiter, kHeader, kBody, kEpilogue };

  bool Step();
  bool ReadUntilDelimiter();
  bool ReadDelimiterEnd();
  bool ReadHeader();

  std::string delimiter_;
  Events events_;
  State state_ = State::kPreamble;
  std::string buffer_;
};

}  // namespace radbake::server
