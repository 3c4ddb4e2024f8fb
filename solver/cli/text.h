/// Numbers and messages as people read them.
#pragma once

#include <string>
#include <string_view>

namespace radbake::cli {

/// "1.72 %" for 0.0172; three significant digits.
std::string Percent(double share);

/// "+0.1 %", "-0.1 %".
std::string SignedPercent(double share);

/// "0.31 s", "12 s", "3 min 20 s".
std::string Duration(double seconds);

/// A message on one line: every control character becomes a space.
std::string OneLine(std::string_view message);

}  // namespace radbake::cli
