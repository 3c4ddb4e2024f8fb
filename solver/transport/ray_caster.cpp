#include "solver/transport/ray_caster.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <new>
#include <stdexcept>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace radbake {
namespace {

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

// How far a ray reaches beyond both of its ends, so that single-precision rounding loses no triangle that
// lies close to one of them: which triangles count is decided in double, by the filters.
constexpr double kSlack = 1e-6;

// dot(normal, x) == offset, unit normal; a zero normal for a degenerate triangle, which no point is off.
struct TrianglePlane {
  Vec3 normal = Vec3::Zero();
  double offset = 0;

  double Distance(const Vec3& point) const { return normal.dot(point) - offset; }
};

TrianglePlane PlaneThrough(const Corners& corners) {
  const Vec3 u = corners[1] - corners[0];
  const Vec3 v = corners[2] - corners[0];
  const Vec3 cross = u.cross(v);
  const double longest = std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
  const double norm = cross.norm();
  if (!(norm > 1e-12 * longest)) {
    return {};
  }
  const Vec3 normal = cross / norm;
  return {normal, normal.dot((corners[0] + corners[1] + corners[2]) / 3)};
}

struct SegmentQuery {
  QueryContext context;  // first: Embree hands back a pointer to it
  const Vec3* from;
  const Vec3* to;
};

struct ClosestQuery {
  QueryContext context;  // first, as above
  const Vec3* origin;
  const Vec3* direction;
  float embree_distance;
  Index triangle;
  double distance;
  bool front;
};

const TrianglePlane& HitPlane(const RTCFilterFunctionNArguments* arguments, Index triangle) {
  return static_cast<const TrianglePlane*>(arguments->geometryUserPtr)[triangle];
}

void FilterOccluded(const RTCFilterFunctionNArguments* arguments) {
  const auto& query = *reinterpret_cast<const SegmentQuery*>(arguments->context);
  const TrianglePlane& plane = HitPlane(arguments, RTCHitN_primID(arguments->hit, 1, 0));
  const double from = plane.Distance(*query.from);
  const double to = plane.Distance(*query.to);
  constexpr double kTolerance = RayCaster::kPlaneTolerance;
  const bool separated = (from > kTolerance && to < -kTolerance) || (from < -kTolerance && to > kTolerance);
  if (!separated) {
    arguments->valid[0] = 0;
  }
}

void FilterClosest(const RTCFilterFunctionNArguments* arguments) {
  auto& query = *reinterpret_cast<ClosestQuery*>(const_cast<QueryContext*>(arguments->context));
  const Index triangle = RTCHitN_primID(arguments->hit, 1, 0);
  const TrianglePlane& plane = HitPlane(arguments, triangle);
  const double origin = plane.Distance(*query.origin);
  const double slope = plane.normal.dot(*query.direction);
  const float embree_distance = RTCRayN_tfar(arguments->ray, 1, 0);
  const bool approached = (origin > RayCaster::kPlaneTolerance && slope < 0) ||
                          (origin < -RayCaster::kPlaneTolerance && slope > 0);
  // The tie between two triangles at their shared edge is broken by index, not by the order of the traversal.
  const bool nearer = embree_distance < query.embree_distance ||
                      (embree_distance == query.embree_distance && triangle < query.triangle);
  if (!approached || !nearer) {
    arguments->valid[0] = 0;
    return;
  }
  query.embree_distance = embree_distance;
  query.triangle = triangle;
  query.distance = -origin / slope;
  query.front = slope < 0;
}

// `unit` has length 1; the ray starts kSlack before `origin`.
void SetRay(RTCRay& ray, const Vec3& origin, const Vec3& unit, double length) {
  const Eigen::Vector3f start = (origin - kSlack * unit).cast<float>();
  const Eigen::Vector3f direction = unit.cast<float>();
  ray.org_x = start.x();
  ray.org_y = start.y();
  ray.org_z = start.z();
  ray.tnear = 0;
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.time = 0;
  ray.tfar = static_cast<float>(length + 2 * kSlack);
  ray.mask = UINT32_MAX;
  ray.id = 0;
  ray.flags = 0;
}

/// Times one ray in so many while it lives; to read the clock for each would cost as much as some rays do.
class Stopwatch {
 public:
  explicit Stopwatch(std::atomic<std::uint64_t>& nanoseconds) {
    thread_local unsigned turn = 0;
    if (turn++ % kEvery == 0) {
      nanoseconds_ = &nanoseconds;
      start_ = Clock::now();
    }
  }
  ~Stopwatch() {
    if (nanoseconds_ != nullptr) {
      const std::chrono::nanoseconds spent = std::clamp(Clock::now() - start_ - ClockCost(), {}, kLongest);
      nanoseconds_->fetch_add(kEvery * static_cast<std::uint64_t>(spent.count()), std::memory_order_relaxed);
    }
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr unsigned kEvery = 32;
  // No ray takes longer: a thread that had to wait for a processor would count kEvery times.
  static constexpr std::chrono::nanoseconds kLongest = std::chrono::microseconds(50);

  static std::chrono::nanoseconds ClockCost() {
    static const std::chrono::nanoseconds kCost = [] {
      auto least = Clock::duration::max();
      for (int k = 0; k < 100; ++k) {
        const auto start = Clock::now();
        least = std::min(least, Clock::now() - start);
      }
      return least;
    }();
    return kCost;
  }

  std::atomic<std::uint64_t>* nanoseconds_ = nullptr;
  Clock::time_point start_;
};

}  // namespace

struct RayCaster::Impl {
  std::vector<TrianglePlane> planes;
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::atomic<std::uint64_t> nanoseconds{0};

  ~Impl() {
    if (scene != nullptr) {
      rtcReleaseScene(scene);
    }
    if (device != nullptr) {
      rtcReleaseDevice(device);
    }
  }

  void ThrowOnError() const {
    const RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_OUT_OF_MEMORY) {
      throw std::bad_alloc();
    }
    if (error != RTC_ERROR_NONE) {
      throw std::runtime_error("Embree failed with error " + std::to_string(error));
    }
  }
};

RayCaster::RayCaster(std::span<const Corners> triangles) : impl_(std::make_unique<Impl>()) {
  impl_->planes.reserve(triangles.size());
  for (const Corners& corners : triangles) {
    impl_->planes.push_back(PlaneThrough(corners));
  }
  // There is nothing to tessellate, and what is reserved for it, 128 MiB, counts under a resource limit.
  impl_->device = rtcNewDevice("tessellation_cache_size=0");
  impl_->ThrowOnError();
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  if (!triangles.empty()) {
    RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* positions = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * triangles.size()));
    auto* indices = static_cast<Index*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(Index), triangles.size()));
    if (positions != nullptr && indices != nullptr) {
      Index corner_index = 0;
      for (const Corners& corners : triangles) {
        for (const Vec3& corner : corners) {
          *indices++ = corner_index++;
          for (const double coordinate : corner) {
            *positions++ = static_cast<float>(coordinate);
          }
        }
      }
      rtcSetGeometryUserData(geometry, impl_->planes.data());
      rtcSetGeometryOccludedFilterFunction(geometry, FilterOccluded);
      rtcSetGeometryIntersectFilterFunction(geometry, FilterClosest);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(impl_->scene, geometry);
    }
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(impl_->scene);
  impl_->ThrowOnError();
}

RayCaster::~RayCaster() = default;

double RayCaster::Seconds() const {
  return 1e-9 * static_cast<double>(impl_->nanoseconds.load());
}

bool RayCaster::Occluded(const Vec3& a, const Vec3& b) const {
  const Vec3 difference = b - a;
  const double length = difference.norm();
  if (!(length > 0)) {
    return false;
  }
  RTCRay ray;
  SetRay(ray, a, difference / length, length);
  SegmentQuery query{.context = {}, .from = &a, .to = &b};
  const Stopwatch stopwatch(impl_->nanoseconds);
#if RTC_VERSION_MAJOR >= 4
  rtcInitRayQueryContext(&query.context);
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &query.context;
  rtcOccluded1(impl_->scene, &ray, &arguments);
#else
  rtcInitIntersectContext(&query.context);
  rtcOccluded1(impl_->scene, &query.context, &ray);
#endif
  return ray.tfar < 0;
}

std::optional<RayCaster::Hit> RayCaster::Closest(const Vec3& origin, const Vec3& direction) const {
  constexpr auto kInfinity = std::numeric_limits<double>::infinity();
  RTCRayHit ray;
  SetRay(ray.ray, origin, direction.normalized(), kInfinity);
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ClosestQuery query{.context = {},
                     .origin = &origin,
                     .direction = &direction,
                     .embree_distance = std::numeric_limits<float>::infinity(),
                     .triangle = kNone,
                     .distance = 0,
                     .front = false};
  const Stopwatch stopwatch(impl_->nanoseconds);
#if RTC_VERSION_MAJOR >= 4
  rtcInitRayQueryContext(&query.context);
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &query.context;
  rtcIntersect1(impl_->scene, &ray, &arguments);
#else
  rtcInitIntersectContext(&query.context);
  rtcIntersect1(impl_->scene, &query.context, &ray);
#endif
  if (query.triangle == kNone) {
    return std::nullopt;
  }
  return Hit{.triangle = query.triangle, .distance = query.distance, .front = query.front};
}

}  // namespace radbake
