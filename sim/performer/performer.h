// Performer, its parts and its outer surface.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "base/geometry/mesh.h"
#include "sim/performer/motion.h"

namespace v3d::sim {

class SkinnedModel;

// Performers as closed parts with procedural textures.

enum class Material : uint8_t {
  kSkin,
  kFace,
  kHair,
  kJacket,
  kTrousers,
  kBelt,
  kSock,
  kBlade,
  kHandle,
  kGuard
};

/// The colours of clothes and hair.
enum class Palette : uint8_t { kIndigo, kPlum };

/// A performer with a sword, or a body from a file.
struct Performer {
  Motion motion;
  Palette palette = Palette::kIndigo;
  std::shared_ptr<const SkinnedModel> model = nullptr;  ///< replaces body, sword and motion
};

/// The performers of the simulated studio. 1: one who cuts alone. 2: two who fight; their blades
/// cross, and twice in a period hands and arms touch, so that their hulls are one component in a
/// third of the pulses. Requires a count of 1 or 2.
std::vector<Performer> cast_of(int performers);

/// A closed, outward-oriented surface (world frame, metres). `paint`: by vertex the texture
/// coordinates in the rest frame of the part (metres), so that the texture moves with the part.
/// mesh.colours is empty.
struct Part {
  Mesh mesh;
  std::vector<Eigen::Vector3f> paint;
  Material material = Material::kSkin;
  Palette palette = Palette::kIndigo;
  bool is_sleeve = false;
};

/// Body, clothes and sword, or the parts of the model; parts overlap. `seed` determines folds and
/// patterns, but not the motion.
std::vector<Part> performer_parts(double seconds, uint64_t seed, const Performer& performer = {});

/// The blade only, which moves fast enough for motion blur. No triangles for a model.
Part sword_blade(double seconds, const Performer& performer = {});

/// The procedural texture: linear diffuse R, G, B (0 to 1) at texture coordinates `place`. It has
/// more detail than the cameras resolve.
Eigen::Vector3f paint(Material material, const Eigen::Vector3f& place, uint64_t seed,
                      Palette palette = Palette::kIndigo);

// The outer surface of the performer, which is the ground truth for reconstructions. performer_at()
// also has surfaces inside other parts.

/// All triangles without a vertex inside another part, with vertex colours of paint(). Gaps of
/// about a triangle's size remain where parts meet.
Mesh outer_surface(const std::vector<Part>& parts, uint64_t seed);

/// Whether `point` is inside a closed, outward-oriented mesh (winding number along a ray).
bool is_inside(const Mesh& mesh, const Eigen::Vector3f& point);

// Generalised cylinders: closed surfaces of rings of any shape along a path, with a point at each
// end. Each part of the performer is one.

/// A ring: center + r(angle) (cos(angle) u + sin(angle) v). `u x v` points from the start to the
/// end of the tube, so that triangles face outward.
struct Ring {
  Eigen::Vector3d center, u, v;
  /// z of its texture coordinates in the rest frame; x and y are lengths along u and v.
  double height = 0;
};

/// Radius of ring `k` at `angle`, as a factor of u and v.
using RingShape = std::function<double(int k, double angle)>;

/// A tube with `sides` vertices per ring. The end points are the centres of the first and last ring
/// plus `start_cap` and `end_cap`. Requires at least two rings and three sides.
Part make_tube(Material material, const std::vector<Ring>& rings, int sides, const RingShape& shape,
               const Eigen::Vector3d& start_cap, const Eigen::Vector3d& end_cap);

/// A capsule with two radii. `flat` scales the radius perpendicular to `reference`, which must not
/// be parallel to the axis. The texture coordinate z is 0 at `from`.
Part make_capsule(Material material, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                  double from_radius, double to_radius, const Eigen::Vector3d& reference,
                  double flat = 1.0, int sides = 20, int rings = 8);

/// An ellipsoid with semi-axes along the columns of `axes` (right-handed), which also are the axes
/// of its texture coordinates.
Part make_ellipsoid(Material material, const Eigen::Vector3d& center, const Eigen::Matrix3d& axes,
                    const Eigen::Vector3d& radii, int sides = 32, int rings = 20);

// Points that stay at the same place of a performer's surface: the truth for tracked surfaces.

/// Parts that figures of tracking list.
enum class PointGroup : uint8_t { kOther, kSleeve, kSword };

/// Immutable; any thread.
class SurfacePoints {
 public:
  /// `count` points, evenly by area, on the surfaces of `parts`. Some are inside other parts.
  /// Deterministic for each `seed`.
  SurfacePoints(const std::vector<Part>& parts, size_t count, uint64_t seed);

  const std::vector<PointGroup>& groups() const { return groups_; }
  /// The points at another time: `parts` are the same parts then. World, metres.
  std::vector<Eigen::Vector3f> positions(const std::vector<Part>& parts) const;
  /// The outward unit normals of the triangles at the points.
  std::vector<Eigen::Vector3f> normals(const std::vector<Part>& parts) const;

 private:
  struct Point {
    uint32_t part = 0, triangle = 0;
    Eigen::Vector3f weights = Eigen::Vector3f::Zero();  ///< barycentric
  };
  /// The vertices of the point's triangle.
  static std::array<Eigen::Vector3f, 3> corners(const std::vector<Part>& parts, const Point& point);

  std::vector<Point> points_;
  std::vector<PointGroup> groups_;
};

}  // namespace v3d::sim
