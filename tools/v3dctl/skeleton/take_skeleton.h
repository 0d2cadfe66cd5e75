// Skeleton of a take: learnt from its meshes, written as JSON, BVH and TRC; retrieval of poses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "recon/skeleton/kinematic_structure.h"
#include "recon/skeleton/tracked_skeleton.h"
#include "recon/texture/texture_atlas.h"
#include "take/take.h"

namespace v3d::ctl {

class TexturePainter;

struct TakeSkeleton {
  double rate_hz = 0;
  std::vector<int64_t> pulses;  ///< of the meshes that were read
  recon::KinematicStructure structure;
  std::vector<recon::TrackedBody> tracked;  ///< segments of motion.v3d; none without the file
  std::vector<recon::Skin> skins;           ///< of each
  std::string unused_motion;  ///< why motion.v3d is not used; empty: it is, or does not exist
  /// One line for each kind of problem: pulses without a body, several performers, and
  /// doubts_about() the joints.
  std::vector<std::string> problems;
  bool is_unfinished = false;  ///< mesh.v3d has no index: pulses may be missing
  double graph_ms = 0;         ///< median time of one graph
};

/// Half of the memory that is available.
uint64_t default_max_surface_bytes();

/// Learns the skeleton of a reconstructed take, also from its motion.v3d where that exists.
/// `performer`: whose, where vertices have labels; otherwise 1, that of the largest component.
/// Calls `on_begin` with the number of pulses and `on_pulse` after each. Throws InputError for a
/// take without meshes, for another performer than 1 where vertices have no labels, where no pulse
/// shows a body, and before `on_begin` where the tracked surfaces of the pulses would need more
/// than `max_surface_bytes` of memory; std::runtime_error after an interrupt.
TakeSkeleton learn_skeleton(const std::filesystem::path& take, take::FrameRange frames,
                            int performer, const std::function<void(int64_t)>& on_begin,
                            const std::function<void()>& on_pulse,
                            uint64_t max_surface_bytes = default_max_surface_bytes());

/// A line for each reason to doubt the joints: no pulse shows the ends of a body, or the body does
/// not stand upright.
std::vector<std::string> doubts_about(const recon::KinematicStructure& structure);

/// skeleton.json (docs/skeleton.md), with the skins of tracked surfaces unless `skins` is false.
std::string skeleton_json(const TakeSkeleton& skeleton, bool skins = true);
/// Biovision hierarchy: metres, y up, one frame for each pulse from the first to the last with a
/// skeleton; between two of them blended(). Throws InputError for more than 1,000,000 frames.
std::string skeleton_bvh(const TakeSkeleton& skeleton);
/// Marker file of OpenSim and Pose2Sim: metres, y up. Time is that of the pulse.
std::string skeleton_trc(const TakeSkeleton& skeleton, const std::string& name);

/// glTF 2.0 binary: an animated armature for each tracked segment, and its surface with a skin;
/// shown in turn. Joints have the names of skeleton.json, and positions and rotations at each
/// pulse. `name`: of the take. `textures`: skin_textures(), in place of the colours of vertices;
/// empty: none. Throws InputError for a skeleton without a skin.
std::string skeleton_glb(const TakeSkeleton& skeleton, const std::string& name,
                         std::span<const recon::TextureAtlas> textures = {});

/// A texture of each tracked surface, of `side` texels; empty for a surface without a skin. It has
/// the colours at the rest pulse. A place that no camera sees then has those of other pulses of the
/// segment, of which up to twelve are read. Throws std::runtime_error after an interrupt.
std::vector<recon::TextureAtlas> skin_textures(const TakeSkeleton& skeleton,
                                               TexturePainter& painter, int side);

struct SimilarPose {
  int64_t pulse = 0;
  double similarity = 0;
};

struct SimilarPoseList {
  std::vector<SimilarPose> poses;  ///< best first
  /// Mesh files of the takes that have no index: pulses may be missing.
  std::vector<std::filesystem::path> unfinished;
};

/// The pulses of `other` most similar to `pulse` of `take`, half a second apart. In the same take
/// without the query and its neighbours. Throws InputError for an unknown pulse, and for one whose
/// mesh is empty.
SimilarPoseList similar_poses(const std::filesystem::path& take, int64_t pulse,
                              const std::filesystem::path& other, take::FrameRange frames,
                              size_t count);

// Tracked surfaces of a take as bodies with a skin.

/// The segments of a motion file at the given pulses (ascending), with the colours of the rest
/// pulse. Segments of fewer than three such pulses are left out. Throws InputError for a damaged
/// file.
std::vector<recon::TrackedBody> read_tracked_bodies(const std::filesystem::path& file,
                                                    std::span<const int64_t> pulses);

/// Distances of limbs that the skeleton moves from the tracked surface.
struct SkinError {
  double p50_mm = 0, p90_mm = 0;
  int64_t pulses = 0;
};

/// Over all vertices of arms and legs at all pulses.
SkinError skin_error(std::span<const recon::TrackedBody> bodies,
                     std::span<const recon::Skin> skins);

// A skeleton against the true joints of a simulated take: skeleton_truth.cc

struct JointError {
  double p50_mm = 0, p90_mm = 0;
};

struct SkeletonError {
  int64_t pulses = 0;  ///< with a skeleton and true joints
  JointError all;      ///< of the main joints at these pulses
  std::map<std::string, JointError> of_joint;
  /// Pulses at which the joints would be nearer to the true ones with left and right exchanged.
  int64_t swaps = 0;
};

/// Throws InputError for a `truth`/joints.json that cannot be read or has no main joint of this
/// performer.
void require_true_joints(const std::filesystem::path& truth, int performer);

/// Compares with `truth`/joints.json, which v3d-sim take --truth writes (docs/simulator.md).
/// `performer`: from 1. Throws InputError as require_true_joints(), and where no pulse has both.
SkeletonError compare_with_truth(const TakeSkeleton& skeleton, const std::filesystem::path& truth,
                                 int performer);

/// Largest difference of a bone's length between two pulses, as a part of its length.
double bone_length_spread(const TakeSkeleton& skeleton);

}  // namespace v3d::ctl
