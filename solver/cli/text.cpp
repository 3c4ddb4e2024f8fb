#include "solver/cli/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace radbake::cli {
namespace {

std::string Print(const char* format, double value) {
  std::array<char, 64> text{};
  // The formats are the literals below.
  const int length = std::snprintf(text.data(), text.size(), format, value);  // NOLINT
  return {text.data(), std::min(text.size() - 1, static_cast<std::size_t>(std::max(length, 0)))};
}

}  // namespace

std::string Percent(double share) {
  return Print("%.3g %%", 100 * share);
}

std::string SignedPercent(double share) {
  return Print("%+.3g %%", 100 * share);
}

std::string Duration(double seconds) {
  if (seconds < 100) {
    return Print("%.3g s", seconds);
  }
  const double minutes = std::floor(seconds / 60);
  return Print("%.0f min ", minutes) + Print("%.0f s", std::floor(seconds - 60 * minutes));
}

std::string OneLine(std::string_view message) {
  std::string line(message);
  std::ranges::replace_if(line, [](char c) { return (c >= 0 && c < ' ') || c == '\x7f'; }, ' ');
  while (line.ends_with(' ')) {
    line.pop_back();
  }
  return line;
}

}  // namespace radbake::cli
