#include "solver/check/sample_points.h"

namespace radbake {
namespace {

std::uint32_t ReverseBits(std::uint32_t x) {
  x = ((x & 0x55555555U) << 1U) | ((x >> 1U) & 0x55555555U);
  x = ((x & 0x33333333U) << 2U) | ((x >> 2U) & 0x33333333U);
  x = ((x & 0x0F0F0F0FU) << 4U) | ((x >> 4U) & 0x0F0F0F0FU);
  x = ((x & 0x00FF00FFU) << 8U) | ((x >> 8U) & 0x00FF00FFU);
  return (x << 16U) | (x >> 16U);
}

// The second dimension of Sobol's sequence: Pascal's triangle modulo 2 times the index's bits. That matrix is
// the fifth Kronecker power of ((1, 1), (0, 1)), hence five steps. Bits reversed: the lowest is worth 1/2.
std::uint32_t SobolSecondReversed(std::uint32_t index) {
  std::uint32_t x = index;
  x ^= (x & 0xAAAAAAAAU) >> 1U;
  x ^= (x & 0xCCCCCCCCU) >> 2U;
  x ^= (x & 0xF0F0F0F0U) >> 4U;
  x ^= (x & 0xFF00FF00U) >> 8U;
  x ^= x >> 16U;
  return x;
}

// Each bit is flipped by a hash of the bits below it. Laine, Karras: Stratified sampling for stochastic
// transparency, 2011; multipliers: Burley: Practical hash-based Owen scrambling, 2020.
std::uint32_t FlipByLowerBits(std::uint32_t x, std::uint32_t seed) {
  x ^= x * 0x3D20ADEAU;
  x += seed;
  x *= (seed >> 16U) | 1U;
  x ^= x * 0x05526C56U;
  x ^= x * 0x53A22864U;
  return x;
}

// Owen's scrambling: each bit is flipped by a hash of the bits above it.
double Owen(std::uint32_t reversed, std::uint32_t seed) {
  return ReverseBits(FlipByLowerBits(reversed, seed)) * 0x1p-32;
}

}  // namespace

std::uint64_t Scramble(std::uint64_t bits) {
  // SplitMix64. Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014.
  bits += 0x9E3779B97F4A7C15U;
  bits = (bits ^ (bits >> 30U)) * 0xBF58476D1CE4E5B9U;
  bits = (bits ^ (bits >> 27U)) * 0x94D049BB133111EBU;
  return bits ^ (bits >> 31U);
}

std::array<double, 2> SamplePoints::Point(std::uint32_t index, std::uint32_t dimension) const {
  const std::uint64_t a = SubStream(stream_, dimension);
  const std::uint64_t b = Scramble(a);
  // Shuffled within every aligned block of 2ⁿ indices, so that dimensions do not run in step.
  const std::uint32_t shuffled =
      ReverseBits(FlipByLowerBits(ReverseBits(index), static_cast<std::uint32_t>(a)));
  return {Owen(shuffled, static_cast<std::uint32_t>(a >> 32U)),
          Owen(SobolSecondReversed(shuffled), static_cast<std::uint32_t>(b))};
}

}  // namespace radbake
