/// What every fuzzer defines, and what it does where an input shows a fault.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

/// One input. It ends with 0, or the process does.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);  // NOLINT

namespace radbake::fuzz {

inline std::string_view Text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// What must hold of every input.
inline void Demand(bool holds, const char* what) {
  if (!holds) {
    std::fprintf(stderr, "this does not hold: %s\n", what);
    std::abort();
  }
}

}  // namespace radbake::fuzz
