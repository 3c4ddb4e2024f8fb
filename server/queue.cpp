#include "server/queue.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace radbake::server {
namespace {

constexpr std::array<std::string_view, 5> kStatusNames = {"queued", "running", "succeeded", "failed",
                                                          "canceled"};

}  // namespace

std::string_view ToString(Status status) {
  return kStatusNames.at(static_cast<std::size_t>(status));
}

std::optional<Status> StatusFrom(std::string_view name) {
  const auto* const found = std::find(kStatusNames.begin(), kStatusNames.end(), name);
  return found == kStatusNames.end() ? std::nullopt
                                     : std::optional(static_cast<Status>(found - kStatusNames.begin()));
}

std::string Cursor(const Job& job) {
  return std::to_string(job.sequence);
}

bool IsCursor(const std::string& text) {
  std::int64_t sequence = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), sequence);
  return error == std::errc() && end == text.data() + text.size() && sequence >= 0;
}

}  // namespace radbake::server
