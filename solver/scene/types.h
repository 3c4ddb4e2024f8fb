/// The few types that every folder shares: vectors, colours, and the error that names bad input.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace radbake {

/// A point or direction. Metres in world space, unless a name says otherwise.
using Vec3 = Eigen::Vector3d;

/// A linear RGB triple; the channels are independent (DESIGN: reflectance, radiance, irradiance, radiosity).
using Rgb = Eigen::Array3d;

/// Rec. 709 luminance of a linear RGB triple.
inline double Luminance(const Rgb& rgb) {
  return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

/// Index of a vertex, triangle, patch or element in its array.
using Index = std::uint32_t;
inline constexpr Index kNone = UINT32_MAX;

/// The three vertices of a triangle, counter-clockwise seen from the front.
using Triangle = std::array<Index, 3>;

/// Bad input (a scene, a parameter, a file name): the caller's to mend, exit code 2. what() is one line that
/// names what is wrong and where.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace radbake
