/// The element hierarchy: over every patch a quadtree of elements, sharing corners with their neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "solver/hierarchy/clusters.h"
#include "solver/hierarchy/division.h"
#include "solver/scene/patches.h"
#include "solver/scene/polygon.h"

namespace radbake {

/// A node of a patch's quadtree; see Division for its children.
struct Element {
  std::array<Index, 4> corner{kNone, kNone, kNone, kNone};  ///< vertices; corner[3] is kNone for a triangle
  Index patch = 0;
  Index parent = kNone;
  Index first_child = kNone;                ///< four in a row, or kNone: a leaf
  Division division = Division::kTriangle;  ///< unless it is a leaf
  double area = 0;                          ///< normalised

  int CornerCount() const { return corner[3] == kNone ? 3 : 4; }
  bool IsLeaf() const { return first_child == kNone; }
};

/// Elements, and the vertices they meet in. A *position* is a place; a *vertex* is a place on one smooth or
/// flat surface, where irradiance is continuous: at a crease several vertices share a position. An edge that
/// two elements share has one midpoint, so that neighbours never disagree by a bit.
///
/// Elements 0 to patches.size() − 1 are the roots, in the patches' order. Divide() is for one thread at a
/// time; everything const may be called concurrently between divisions.
class Hierarchy {
 public:
  /// `clustering`: with clusters above the patches.
  explicit Hierarchy(const Patches& patches, bool clustering = false);

  const Patches& patches() const { return patches_; }
  const Clusters& clusters() const { return clusters_; }
  const Patch& PatchOf(Index element) const { return patches_.patches[elements_[element].patch]; }
  std::size_t size() const { return elements_.size(); }
  std::size_t root_count() const { return patches_.patches.size(); }
  /// The roots that belong to surfaces, before the sky's.
  std::size_t surface_root_count() const { return patches_.surface_patches; }
  bool IsSky(Index element) const { return elements_[element].patch >= patches_.surface_patches; }
  const Element& operator[](Index element) const { return elements_[element]; }
  Polygon Shape(Index element) const;

  /// Of an element or a cluster: the area of its surfaces.
  double Area(Index node) const;
  /// Of any node with an extent: the middle, and the radius of a sphere around it that holds it.
  Vec3 Centre(Index node) const;
  double Radius(Index node) const;

  /// Divides a leaf into its four children, long quadrilaterals into shorter ones, and returns the first. No
  /// effect on one that is divided already.
  Index Divide(Index element);
  /// The child of an element that is divided that holds `x`, or is near.
  Index ChildAt(Index element, const Vec3& x) const;

  std::size_t vertex_count() const { return position_of_.size(); }
  const Vec3& Point(Index vertex) const { return positions_[position_of_[vertex]]; }
  Index PositionOf(Index vertex) const { return position_of_[vertex]; }

  /// The position halfway between two, if some element has been divided there; else kNone.
  Index FindMidpoint(Index position_a, Index position_b) const;
  /// The vertex halfway between two vertices of one surface, made if it is not there yet.
  Index MidVertex(Index vertex_a, Index vertex_b);

  /// Of memory that grows with the elements: not those of the clusters.
  std::size_t Bytes() const;

 private:
  Division HowToDivide(Index element) const;
  Index AddPosition(const Vec3& point);
  Index AddVertex(Index position);
  void WeldCorners();
  Index AddChild(Index parent, const std::array<Index, 4>& corner);

  const Patches& patches_;
  Clusters clusters_;
  std::vector<Element> elements_;
  std::vector<Vec3> positions_;
  std::vector<Index> position_of_;
  std::unordered_map<std::uint64_t, Index> mid_position_;
  std::unordered_map<std::uint64_t, Index> mid_vertex_;
};

}  // namespace radbake
