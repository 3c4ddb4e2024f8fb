/// Makes links and refines them: the one mechanism behind every oracle (Hanrahan, Salzman, Aupperle 1991,
/// sections 3 and 4: Refine, Link, RefineLink).
#pragma once

#include <functional>
#include <utility>

#include "solver/hierarchy/basis.h"
#include "solver/refine/oracle.h"
#include "solver/transport/visibility.h"

namespace radbake {

class Linker {
 public:
  /// `visibility_rays`: cast for a link that no shaft proves clear; to and from clusters and lights half as
  /// many, by which the link is judged, and twice as many if it is kept. From an element that emits more than
  /// the mean of all surfaces as many times more, up to `direct_rays`: what it sends is known beforehand to
  /// be most of the light. Both even. `order`: of the basis, which says what of the form factor's variation
  /// is left over.
  Linker(Hierarchy& hierarchy, const Visibility& visibility, int visibility_rays, int direct_rays,
         BasisOrder order = BasisOrder::kConstant);

  /// `hold` is told of the links from now on, those that are about to be replaced or made too, and of
  /// BytesOfElements().
  void TellOfBytes(Hold hold) { hold_ = std::move(hold); }

  /// Links every two patches that face one another, and each patch to every light; or, with clusters, the
  /// root cluster to itself, to the sky and to every light.
  void LinkRoots();

  /// Replaces each link that the oracle does not keep by links one level down, until it keeps all. `stop` is
  /// asked now and then; true leaves the links of the last whole round. Returns the number of links replaced.
  /// The same result on any number of threads.
  std::size_t Refine(const Oracle& oracle, const std::function<bool()>& stop);

  const Links& links() const { return links_; }
  /// Leaves none.
  Links TakeLinks() { return std::exchange(links_, {}); }
  /// Form factors computed so far, those of links that were replaced or that carry nothing too.
  std::size_t measured() const { return measured_; }
  /// Of memory that grows with the elements, beside what the hierarchy holds itself.
  std::size_t BytesOfElements() const { return basis_.Bytes(); }

 private:
  /// Form factor and visibility of a link whose ends are set; one that carries nothing has form_factor 0.
  /// What rays find is there to be judged first.
  void Measure(Link& link) const;
  /// All, unless `stop` says true.
  bool MeasureAll(std::span<Link> links, const std::function<bool()>& stop);
  void MeasureElements(Link& link) const;
  void MeasureNodes(Link& link) const;
  /// What links that the oracle keeps carry, by rays of their own. All, unless `stop` says true.
  bool CarryAll(std::span<Link> links, const std::function<bool()>& stop);
  /// How many links Replace() makes, at most.
  std::size_t CountOfReplaced(const Link& link, Decision decision) const;
  /// Tells `hold` of those bytes beside what the linker has anyway.
  void Tell(std::size_t bytes) const;
  void Assign(std::vector<Link>& links);
  /// Of `kernel` over the receiver, whose point next to the shooter is `nearest`.
  template <typename Kernel>
  double Variation(Index receiver, const Vec3& nearest, const Kernel& kernel) const;
  void Replace(const Link& link, Decision decision, std::vector<Link>& next);
  int RaysFrom(Index shooter) const;

  Hierarchy& hierarchy_;
  const Visibility& visibility_;
  int rays_;
  int direct_rays_;
  double mean_emission_ = 0;  // of the surfaces, luminous
  double tolerance_;          // of form factors
  Basis basis_;
  Links links_;
  std::vector<PatchShare> shares_;  // while links are refined, of all that are carried or were
  std::size_t measured_ = 0;
  Hold hold_;
};

}  // namespace radbake
