// Training sets of other reconstruction programs: undistorted images and masks of a pulse, pinhole
// cameras, and the vertices of its mesh as initial points.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/texture/undistortion.h"

namespace v3d::ctl {

/// A point in an image.
struct PointInImage {
  size_t point = 0;                                 ///< index in TrainingPulse::points
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< of the undistorted image; the centre of
                                                    ///< the first pixel is (0, 0)
};

/// A camera with its undistorted image of one pulse.
struct TrainingView {
  std::string camera;
  CameraModel model;           ///< without distortion, see pinhole_of()
  recon::MaskedImage picture;  ///< colours are corrected by the camera's ColourResponse
  /// The points that the camera sees (recon::Visibility), ascending.
  std::vector<PointInImage> points;
};

struct TrainingPulse {
  /// The vertices that at least one camera sees, world, metres, with the colours of the mesh (or
  /// none). No triangles.
  Mesh points;
  std::vector<TrainingView> views;  ///< in the order of the take's cameras
};

/// Reader of training sets of a take. One thread; uses several processors.
class TrainingPulses {
 public:
  /// Throws InputError for a folder that is no take, and for a take without raw frames; the message
  /// begins with `option`.
  TrainingPulses(const std::filesystem::path& take, const std::string& option);
  /// The views of `frame`, of all cameras that took part and whose frame can be read. Throws
  /// InputError when there is none. Fast for increasing pulses.
  TrainingPulse of(const recon::CompactFrame& frame);
  /// Number of pulses so far in which a camera that took part was missing or unreadable.
  int64_t incomplete() const { return incomplete_; }

 private:
  std::string option_;
  recorded::TakeFrames frames_;
  int64_t incomplete_ = 0;
};

/// Writes a COLMAP text model and its images: images/CAMERA.png, masks/CAMERA.png.png (COLMAP's
/// rule for masks), sparse/0/cameras.txt, images.txt and points3D.txt.
///
/// Camera frame as in base/geometry/rigid_transform.h (x right, y down, z forward) and world frame
/// of the take, both of which COLMAP keeps; the pose is cam_from_world. Pixels: COLMAP's centre of
/// the first pixel is (0.5, 0.5), ours (0, 0). `folder` must exist. Throws std::runtime_error with
/// the path when a file cannot be written.
/// Source: https://colmap.github.io/format.html
void write_colmap(const std::filesystem::path& folder, const TrainingPulse& pulse);

/// Writes transforms.json, images/CAMERA.png, masks/CAMERA.png and points.ply, as Nerfstudio and
/// Instant-NGP read them.
///
/// A pose is world_from_camera with the axes of OpenGL: x right, y up, z backward, so our y and z
/// change their signs. The world is that of the take: metres, z up. Pixels as in write_colmap().
/// `folder` must exist. Throws std::runtime_error with the path when a file cannot be written.
/// Source: https://docs.nerf.studio/quickstart/data_conventions.html
void write_nerfstudio(const std::filesystem::path& folder, const TrainingPulse& pulse);

}  // namespace v3d::ctl
