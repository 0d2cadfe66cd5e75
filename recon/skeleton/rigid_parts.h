// Rigid parts of a tracked surface: which joint moves each vertex, and how each part moves.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/skeleton/body_model.h"

namespace v3d::recon {

/// A surface of constant topology over several pulses. World frame, metres.
struct TrackedBody {
  Mesh surface;                 ///< triangles; the vertices are at rest: at the pulse `rest`
  size_t rest = 0;              ///< index of the pulse whose positions are those of `surface`
  std::vector<int64_t> pulses;  ///< increasing
  std::vector<std::vector<Eigen::Vector3f>> positions;  ///< [pulse][vertex]
  std::vector<std::vector<Rgb8>> colours;               ///< [pulse][vertex], or no pulse
};

/// The joint that moves a part is at its root: the pelvis moves the hips, the neck the chest, an
/// elbow the forearm with the hand, an ankle the foot, the base of the prop the prop.
inline constexpr std::array kPartJoints{
    kPelvis,  kNeck,     kHead,      kLeftShoulder, kLeftElbow, kRightShoulder, kRightElbow,
    kLeftHip, kLeftKnee, kLeftAnkle, kRightHip,     kRightKnee, kRightAnkle,    kPropBase};

/// Does this joint move a part? Not the wrists and the tip of the prop.
bool moves_part(Joint joint);
/// The part nearer to the pelvis at whose end this part begins; the hips have themselves.
Joint parent_part(Joint part);

/// Rigid motions of all parts from rest to a pulse, by joint. Only entries of parts count.
using PartMotion = std::array<Eigen::Isometry3d, kJoints>;

struct RigidParts {
  std::vector<Joint> part_of;           ///< [vertex]
  std::array<size_t, kJoints> count{};  ///< vertices of each part; motions of empty ones are those
                                        ///< of the parent part
  std::vector<PartMotion> motions;      ///< [pulse]
  /// [pulse]: root mean square distance of the vertices of a part from their rigid motion, metres.
  std::vector<std::array<double, kJoints>> residual_m;
};

/// Divides a tracked surface into rigid parts. `poses`: the joints at each pulse, null where they
/// are not known; at some pulses they may be wrong. Each vertex begins in the part of the capsule
/// of `outline` (body_outline()) that is nearest at most pulses. Then the motions of the parts and
/// the parts of the vertices are improved in turn: a vertex goes to the part that explains its path
/// best, if neighbours agree. Requires a known pose. Works in the caller's TBB arena;
/// deterministic.
///
/// Source: Le and Deng, Smooth skinning decomposition with rigid bones, SIGGRAPH Asia 2012, for the
/// alternation; the start from a skeleton and the agreement of neighbours are our own.
RigidParts rigid_parts(const TrackedBody& body, std::span<const JointPositions* const> poses,
                       std::span<const Capsule> outline, bool has_prop);

}  // namespace v3d::recon
