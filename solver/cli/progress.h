/// How a running bake shows itself: a bar on a terminal, or a JSON object a line.
#pragma once

#include <string>

#include "solver/radbake.h"

namespace radbake::cli {

enum class ProgressMode {
  kAuto,  ///< a bar on standard error if that is a terminal
  kJson,  ///< standard output: {phase, progress, error, seconds, iteration {as in the statistics}} a line
  kNone
};

/// One line without its end: what kJson writes.
std::string ProgressLine(const Progress& progress);

/// The bar, at most `width` columns wide: phase, share, error so far, time left.
std::string ProgressBar(const Progress& progress, std::size_t width);

/// Shows progress until it is destroyed, which clears the bar.
class ProgressDisplay {
 public:
  explicit ProgressDisplay(ProgressMode mode);
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  void Show(const Progress& progress);

 private:
  bool json_;
  bool bar_;
};

}  // namespace radbake::cli
