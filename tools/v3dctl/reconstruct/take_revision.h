// Revisions of the meshes of a reconstructed take: colours of every camera, identities of the
// performers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace v3d::ctl {

struct CameraColourReport {
  int64_t frames = 0;
  int64_t undecodable = 0;  ///< frames that stay as they were: damaged, or without their reference
  /// Frames with a surface, but without colours of cameras: a camera has no readable raw frame, or
  /// the frame is too large (codec::FrameLimits::kCameraColours).
  int64_t without = 0;
  /// Means over all frames, bytes.
  double mean_bytes = 0;        ///< of the colours of cameras
  double mean_frame_bytes = 0;  ///< of the whole frames
  double mean_step = 0;         ///< of luma, grey values, over the frames with these colours
};

/// Calls after each frame.
using FrameCallback = std::function<void()>;

/// Replaces mesh.v3d of `take` by one whose frames also have the colours that each of their cameras
/// sees at the vertices, in at most `max_bytes` bytes a frame. They come from the raw frames. 0:
/// none, which needs no raw frames. Throws InputError for a take without meshes, for a mesh.v3d
/// without an index, for a take without raw frames, and when another program writes the meshes
/// meanwhile; std::runtime_error for errors of the disk and after an interrupt. Then the old
/// mesh.v3d stays.
CameraColourReport add_camera_colours(const std::filesystem::path& take, size_t max_bytes,
                                      const std::function<void(int64_t frames)>& on_begin,
                                      const FrameCallback& on_frame);

/// One performer in the meshes of a take.
struct PerformerPulses {
  int identity = 0;  ///< the label of his vertices, from 1
  int64_t first = 0, last = 0;
  int64_t pulses = 0;        ///< in which he has vertices
  double mean_vertices = 0;  ///< in these pulses
};

struct PerformersReport {
  int64_t frames = 0;
  int64_t undecodable = 0;  ///< frames that stay as they were: damaged, or without their reference
  double unlabelled = 0;    ///< share of all vertices that belong to no performer
  std::vector<PerformerPulses> performers;  ///< ascending by identity
};

/// Tracks the performers (recon::PerformerTracker) through the meshes of `take`, and replaces its
/// mesh.v3d by one with the same meshes that are labelled. Calls `on_frame` after each frame.
/// Throws InputError for a take without meshes, for a mesh.v3d without an index, for meshes that
/// are not surfaces of volumes of one space, and when another program writes them meanwhile;
/// std::runtime_error for errors of the disk and after an interrupt. Then the old mesh.v3d stays.
PerformersReport label_performers(const std::filesystem::path& take,
                                  const std::function<void(int64_t frames)>& on_begin,
                                  const std::function<void()>& on_frame);

}  // namespace v3d::ctl
