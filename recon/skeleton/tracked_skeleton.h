// Skeleton of a tracked surface: rigid parts, the joints where they meet, and the skin.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/skeleton/body_model.h"
#include "recon/skeleton/kinematic_structure.h"

namespace v3d::recon {

// Rigid parts of a tracked surface: which joint moves each vertex, and how each part moves.

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

// Skin: linear blend skinning of a surface by a skeleton.

/// The parts that move a vertex, named by their joints, with weights that sum to 1. Unused entries
/// have weight 0.
struct SkinInfluence {
  static constexpr size_t kParts = 4;  ///< as glTF readers expect
  std::array<Joint, kParts> part{};
  std::array<float, kParts> weight{};
};

/// Parameters of the linear blend skinning of a tracked surface.
struct Skin {
  SkeletonPulse rest;                     ///< the skeleton at the rest pulse of the surface
  std::vector<SkinInfluence> influences;  ///< [vertex]
  /// The skeleton at each pulse of the body. A pulse that the next body shares has another one in
  /// the structure.
  std::vector<SkeletonPulse> poses;
};

/// Motions of all parts from one skeleton to another, by joint.
PartMotion part_motion(const SkeletonPulse& from, const SkeletonPulse& to);

/// Vertices at `positions`, moved by linear blend skinning. One position per influence.
std::vector<Eigen::Vector3f> skinned(const Skin& skin, const PartMotion& motion,
                                     std::span<const Eigen::Vector3f> positions);

/// Learns the weights of the vertices from their paths: each is a blend of its own part and one
/// that touches it, smoothed over the surface. `pulses`: the skeleton at each pulse of the body.
/// Works in the caller's TBB arena; deterministic.
///
/// Source: Le and Deng, Smooth skinning decomposition with rigid bones, SIGGRAPH Asia 2012.
Skin fit_skin(const TrackedBody& body, const RigidParts& parts,
              std::span<const SkeletonPulse> pulses);

// Skeleton of a tracked surface: joints are where rigid parts meet.

/// Learns joints and bone lengths from tracked surfaces: at their pulses the joints of `structure`
/// become the centres of rotation between rigid parts (rigid_parts()), and rotations become those
/// of the parts. Pulses that had no skeleton get one. At other pulses, bones get the new lengths.
/// `numbers`: the pulse of each evidence of the structure, ascending. A pulse of two bodies has the
/// skeleton of the later one, which does not fit the skin of the earlier one: each skin has its own
/// poses. A body without a pulse that has a skeleton is left out, with an empty skin. Returns the
/// skin of each body. Works in the caller's TBB arena; deterministic.
///
/// Sources: Ehrig, Taylor, Duda and Heller, A survey of formal methods for determining the centre
/// of rotation of ball joints, Journal of Biomechanics 39, 2006 (symmetrical centre of rotation
/// estimation).
std::vector<Skin> learn_from_tracked(std::span<const TrackedBody> bodies,
                                     std::span<const int64_t> numbers,
                                     KinematicStructure& structure);

}  // namespace v3d::recon
