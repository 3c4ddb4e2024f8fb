#include "solver/solve/couplings.h"

#include <oneapi/tbb/parallel_for.h>

#include "solver/transport/coupling.h"

namespace radbake {
namespace {

// Their noise is beside that of the link's visibility, times what the shooter varies by.
constexpr int kHiddenRays = 8;

/// Can what the node shoots be uneven? Not where nothing is reflected.
bool MayBeUneven(const Hierarchy& hierarchy, Index node) {
  return IsElement(node) && !hierarchy.IsSky(node) && (hierarchy.PatchOf(node).reflectance > 0).any();
}

}  // namespace

Couplings::Couplings(const Hierarchy& hierarchy, const Visibility& visibility, const Links& links,
                     const Light& light)
    : count_(light.basis.count()) {
  if (count_ == 1) {
    return;
  }
  const std::size_t size = count_ * (count_ - 1);
  couplings_.resize(size * links.size());
  tbb::parallel_for(std::size_t{0}, hierarchy.size(), [&](std::size_t e) {
    const auto element = static_cast<Index>(e);
    const std::span<const Link> own = links.Into(element);
    if (own.empty()) {
      return;
    }
    const BasisEnd receiver(hierarchy, light.basis, element);
    const auto first = static_cast<std::size_t>(own.data() - links.all().data());
    for (std::size_t k = 0; k < own.size(); ++k) {
      const Link& link = own[k];
      if (!(link.visibility > 0) || !MayBeUneven(hierarchy, link.shooter)) {
        continue;
      }
      const std::span<float> couplings = std::span(couplings_).subspan(size * (first + k), size);
      const BasisEnd shooter(hierarchy, light.basis, link.shooter);
      CoupleShaped(receiver, shooter, count_, couplings);
      for (float& coupling : couplings) {
        coupling *= link.visibility;
      }
      if (!link.clear) {
        const std::uint64_t key = Hash(~((static_cast<std::uint64_t>(element) << 32U) | link.shooter));
        const BasisValues moments =
            HiddenMoments(visibility, receiver, shooter, light.basis[link.shooter], key, kHiddenRays);
        for (std::size_t j = 1; j < count_; ++j) {
          couplings[j - 1] += link.form_factor * static_cast<float>(moments[j]);
        }
      }
    }
  });
}

void Couplings::Gather(const Links& links, Index element, std::span<const Rgb> shooting,
                       Coefficients gathered) const {
  const std::span<const Link> own = links.Into(element);
  if (own.empty()) {
    return;
  }
  const std::size_t size = count_ * (count_ - 1);
  const float* coupling =
      couplings_.data() + size * static_cast<std::size_t>(own.data() - links.all().data());
  for (const Link& link : own) {
    if (IsElement(link.shooter)) {
      for (std::size_t i = 0; i < count_; ++i) {
        for (std::size_t j = 1; j < count_; ++j) {
          gathered[i] +=
              static_cast<double>(coupling[(count_ - 1) * i + j - 1]) * shooting[count_ * link.shooter + j];
        }
      }
    }
    coupling += size;
  }
}

}  // namespace radbake
