// Skeleton of a take: learnt from its meshes, written as JSON, BVH and TRC; retrieval of poses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "recon/skeleton/kinematic_structure.h"
#include "recon/skeleton/tracked_skeleton.h"
#include "take/take.h"

namespace v3d::ctl {

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
  double graph_ms = 0;  ///< median time of one graph
};

/// Learns the skeleton of a reconstructed take, also from its motion.v3d where that exists.
/// `performer`: whose, where vertices have labels; otherwise 1, that of the largest component.
/// Calls `on_begin` with the number of pulses and `on_pulse` after each. Throws InputError for a
/// take without meshes, for another performer than 1 where vertices have no labels, and where no
/// pulse shows a body; std::runtime_error after an interrupt.
TakeSkeleton learn_skeleton(const std::filesystem::path& take, take::FrameRange frames,
                            int performer, const std::function<void(int64_t)>& on_begin,
                            const std::function<void()>& on_pulse);

/// A line for each reason to doubt the joints: no pulse shows the ends of a body, or the body does
/// not stand upright.
std::vector<std::string> doubts_about(const recon::KinematicStructure& structure);

/// skeleton.json (docs/skeleton.md), with the skins of tracked surfaces unless `skins` is false.
std::string skeleton_json(const TakeSkeleton& skeleton, bool skins = true);
/// Biovision hierarchy: metres, y up, one frame for each pulse from the first to the last with a
/// skeleton; between two of them blended().
std::string skeleton_bvh(const TakeSkeleton& skeleton);
/// Marker file of OpenSim and Pose2Sim: metres, y up. Time is that of the pulse.
std::string skeleton_trc(const TakeSkeleton& skeleton, const std::string& name);

/// glTF 2.0 binary: an animated armature for each tracked segment, and its surface with a skin;
/// shown in turn. Joints have the names of skeleton.json, and positions and rotations at each
/// pulse. `name`: of the take. Throws InputError for a skeleton without a skin.
std::string skeleton_glb(const TakeSkeleton& skeleton, const std::string& name);

struct SimilarPose {
  int64_t pulse = 0;
  double similarity = 0;
};

/// The pulses of `other` most similar to `pulse` of `take`, best first, half a second apart. In the
/// same take without the query and its neighbours. Throws InputError for an unknown pulse, and for
/// one whose mesh is empty.
std::vector<SimilarPose> similar_poses(const std::filesystem::path& take, int64_t pulse,
                                       const std::filesystem::path& other, take::FrameRange frames,
                                       size_t count);

}  // namespace v3d::ctl
