/// Final gather: the irradiance at a point, gathered anew from the hierarchy's links.
#pragma once

#include <optional>

#include "solver/bake/emitters.h"
#include "solver/bake/surroundings.h"
#include "solver/hierarchy/light.h"
#include "solver/refine/links.h"
#include "solver/transport/seen_polygon.h"
#include "solver/transport/visibility.h"

namespace radbake {

class MeshLight;

struct GatherOptions {
  int rays = 64;             ///< to a shooter that gives all of a point's light; others in proportion
  double uneven = 2e-2;      ///< share of a point's light that may lie elsewhere on a shooter
  double negligible = 4e-4;  ///< share of a point's light that may be wrong without being looked at
  /// Whether a point's light is gathered by rays instead of along links, which many small patches make too
  /// many and too coarse. Wants clusters.
  bool by_rays = false;
  /// By rays, patches below this share of the scene's area get fewer rays: what is small
  /// counts little.
  double full_area = 1e-3;
};

/// The links into an element, its ancestors and the clusters above say which shooters light it; at a point
/// inside, each one's form factor is exact (Lambert's formula), and its visibility is the point's own
/// wherever no shaft proved it open (compare Lischinski, Tampieri, Greenberg, Combining hierarchical
/// radiosity and discontinuity meshing, SIGGRAPH 1993, section 5; Smits 1994 calls it local pass).
///
/// By rays instead, the light of the patches that emit is gathered from each (Emitters), what surfaces
/// reflect and the sky's by rays around the point (FromSurroundings), as the solution or a mesh that was
/// gathered before says (MeshLight), and only that of lights without area along their links. Thread-safe.
class Gatherer {
 public:
  Gatherer(const Hierarchy& hierarchy, const Light& light, const Links& links, const Visibility& visibility,
           const GatherOptions& options);

  /// The youngest descendant of `element` (or itself) that received links or shares the leaf that did, at
  /// `x`; or of the patch that is there, if another lies over `x` (Overlaps).
  Index SolverLeaf(Index element, const Vec3& x) const;

  /// Does no light get to `x` in `leaf`, as under a body that stands there (Visibility::IsSealed)?
  bool IsSealed(const Vec3& x, Index leaf) const;

  /// Does the solution know of no light that gets anywhere in `leaf`?
  bool IsSealed(Index leaf) const { return !(light_.open[leaf] > 0); }

  /// Has `element` no children that the solver made?
  bool IsSolverLeaf(Index element) const {
    return hierarchy_[element].IsLeaf() || hierarchy_[element].first_child >= light_.irradiance.size();
  }

  /// Is the solution over a leaf more than interpolation between its corners can show?
  bool IsCurved() const { return light_.basis.count() > BasisCount(BasisOrder::kLinear); }

  /// GatherOptions::by_rays: then an estimate's variance is what its rays differ by, and they err each for
  /// itself. Along links they are so evenly spread that it is a bound.
  bool IsByRays() const { return emitters_.has_value(); }

  /// Of memory that grows with the elements.
  std::size_t Bytes() const { return BytesOf(seen_); }

  /// Does another patch lie over a part of this one?
  bool MayBeCovered(Index patch) const { return visibility_.overlaps().AnyOver(patch); }

  /// The solution's own irradiance of `leaf` at `x`, normalised, for want of time: a constant or a
  /// polynomial, without a ray.
  Rgb Solved(Index leaf, const Vec3& x) const;

  /// Does `x` see the same from both leaves, so that one answer does for both?
  bool SeesAlike(Index leaf_a, Index leaf_b) const {
    return leaf_a == leaf_b || (emitters_ && hierarchy_[leaf_a].patch == hierarchy_[leaf_b].patch);
  }

  /// May `parts` answers for one place share the rays of one?
  double EffortOfPart(std::size_t parts) const { return emitters_ ? 1.0 / static_cast<double>(parts) : 1; }

  /// The irradiance at `x` inside `leaf` = SolverLeaf(…, x). `x` must not lie on the leaf's outline.
  /// `key` seeds the shadow rays; `effort` times as many are cast as GatherOptions say.
  /// By rays, `mesh` says what surfaces reflect, if it is given, and otherwise the solution.
  Estimate Irradiance(const Vec3& x, Index leaf, std::uint64_t key, double effort = 1,
                      const MeshLight* mesh = nullptr) const;

 private:
  /// From one point along all links.
  struct Look {
    const Vec3& x;
    const Vec3& n;
    double scale;  // luminous irradiance that is worth all of GatherOptions::rays
    double effort;
    bool at_shooter;  // of another look
    const MeshLight* mesh;
    QuasiRandom<2> on_polygon;
    QuasiRandom<3> on_cluster;
    std::uint64_t key;
  };

  Look LookFrom(const Vec3& x, Index leaf, std::uint64_t key, double effort, bool at_shooter,
                const MeshLight* mesh) const;
  Estimate Irradiance(Index leaf, Look look) const;

  /// A shadow's edge shows in many small shooters at once: each gets a ray unless it hardly matters. Hundreds
  /// of links that hardly matter may err the same way, as in a cavity of a cluster: a few of them cast a ray
  /// for all (Russian roulette). The chance of this one, or 0 if it casts none.
  double Chance(const Link& link, const Rgb& shooting, double form_factor, Look& look) const;

  /// What one link brings.
  Estimate Along(const Link& link, Look& look) const;

  /// What its shooter or a part of that brings, `shooting` on the whole: in parts where it is uneven.
  Estimate From(const Link& link, Index shooter, const Rgb& shooting, Look& look) const;

  /// What of `open` is not blocked.
  Estimate Seen(const Link& link, Index shooter, const Rgb& open, double chance, Look& look) const;

  /// By Emitters, FromSurroundings and what is left of the links.
  Estimate ByRays(Look& look, Index leaf, double rays) const;
  /// What a surface reflects there as radiosity.
  Rgb Reflected(const Met& met, const MeshLight* mesh) const;

  /// Along the links into the leaf, its ancestors and the clusters above that `take` says.
  template <typename Take>
  Estimate AlongLinks(Index leaf, Look& look, const Take& take) const;

  /// What is seen of a shooter on the whole; `form_factor`: about its share of what is seen of all.
  Rgb Shooting(Index shooter, double form_factor, const Look& look) const;

  /// Does the point see so much of a leaf that its mean will not do, as before a shadow or a body's foot?
  bool IsUneven(Index shooter, double form_factor, const Look& look) const;

  /// Then: the radiosity of what it sees, gathered there at a few points by form factor, and its variance.
  Estimate ShootingNear(Index shooter, const Rgb& otherwise, Look& look) const;

  const Hierarchy& hierarchy_;
  const Light& light_;
  const Links& links_;
  const Visibility& visibility_;
  GatherOptions options_;
  double typical_ = 0;                // root mean square of the luminous irradiance
  std::vector<SeenPolygon> seen_;     // by element of the solver's; not by rays
  std::optional<Emitters> emitters_;  // by rays
};

}  // namespace radbake
