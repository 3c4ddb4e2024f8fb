#include "solver/cli/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "solver/cli/text.h"

namespace radbake::cli {
namespace {

constexpr const char* kClearLine = "\r\x1b[K";

std::size_t TerminalWidth() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

std::string ProgressLine(const Progress& progress) {
  return nlohmann::ordered_json{{"phase", progress.phase},
                                {"progress", progress.fraction},
                                {"error", progress.error},
                                {"seconds", progress.seconds},
                                {"iteration", ToJson(progress.iteration)}}
      .dump();
}

std::string ProgressBar(const Progress& progress, std::size_t width) {
  constexpr std::size_t kPhaseWidth = 7;
  constexpr double kEnoughToForetell = 0.05;
  std::string left(progress.phase);
  left.resize(std::max(left.size(), kPhaseWidth), ' ');
  const double fraction = std::clamp(progress.fraction, 0.0, 1.0);
  std::string right = " " + std::to_string(static_cast<int>(100 * fraction)) + " %";
  if (progress.error < 1) {
    right += "  error " + Percent(progress.error);
  }
  if (fraction > kEnoughToForetell) {
    right += "  " + Duration(std::ceil(progress.seconds * (1 - fraction) / fraction)) + " left";
  }
  const std::size_t taken = left.size() + right.size() + 3;
  if (taken + 4 > width) {
    return (left + right).substr(0, width);
  }
  const std::size_t cells = std::min<std::size_t>(width - taken, 40);
  const auto full = static_cast<std::size_t>(fraction * static_cast<double>(cells));
  return left + " [" + std::string(full, '#') + std::string(cells - full, '-') + "]" + right;
}

ProgressDisplay::ProgressDisplay(ProgressMode mode)
    : json_(mode == ProgressMode::kJson), bar_(mode == ProgressMode::kAuto && isatty(STDERR_FILENO) != 0) {}

ProgressDisplay::~ProgressDisplay() {
  if (bar_) {
    std::fputs(kClearLine, stderr);
  }
}

void ProgressDisplay::Show(const Progress& progress) {
  if (json_) {
    std::puts(ProgressLine(progress).c_str());
    std::fflush(stdout);
  } else if (bar_) {
    // One column is left free: some terminals wrap when the last is written.
    std::fputs((kClearLine + ProgressBar(progress, TerminalWidth() - 1)).c_str(), stderr);
    std::fflush(stderr);
  }
}

}  // namespace radbake::cli
