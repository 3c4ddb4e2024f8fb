/// The path tracer's random numbers: a pure function of what they are for, evenly spread within a batch.
#pragma once

#include <array>
#include <cstdint>

namespace radbake {

/// 64 bits that look random, from 64 that do not.
std::uint64_t Scramble(std::uint64_t bits);

/// A stream's key from its parent's.
inline std::uint64_t SubStream(std::uint64_t stream, std::uint64_t number) {
  return Scramble(stream + Scramble(number));
}

/// Points of the unit square, in [0, 1): for each dimension, the first 2ⁿ indices are a scrambled (0, 2)-net,
/// and a uniform random sample over the streams. Dimensions are independent of each other.
class SamplePoints {
 public:
  explicit SamplePoints(std::uint64_t stream) : stream_(stream) {}
  std::array<double, 2> Point(std::uint32_t index, std::uint32_t dimension) const;

 private:
  std::uint64_t stream_;
};

}  // namespace radbake
