// Undistorted images: the image that a pinhole camera would have made in the place of a camera.
#pragma once

#include <optional>

#include "base/geometry/camera_model.h"
#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::recon {

/// The camera without distortion and skew. It keeps pose and focal lengths, pixels.
///
/// The principal point is the middle of the image, because some programs assume this. Where that of
/// `camera` is not, the image grows so that the whole image of a lens without distortion fits.
/// Throws InputError, beginning with `name`, when a side would exceed kMaxImageSide.
CameraModel pinhole_of(const CameraModel& camera, const std::string& name);

/// An image, RGB8, with its silhouette.
struct MaskedImage {
  Image image;
  Mask mask;
};

/// Resamples image and silhouette, both of camera.size(), to `pinhole`, which has the pose of
/// `camera`: the image bilinearly, of the silhouette the nearest pixel. Pixels that `camera` does
/// not see are black, and background. One thread.
MaskedImage undistorted(const MaskedImage& source, const CameraModel& camera,
                        const CameraModel& pinhole);

/// The pixel of `pinhole` that shows the world point (metres), by projection through the lens of
/// `camera` and the inverse of its distortion. Empty where a camera does not see it, and outside
/// the image of `pinhole`.
std::optional<Eigen::Vector2d> undistorted_pixel(const Eigen::Vector3d& world,
                                                 const CameraModel& camera,
                                                 const CameraModel& pinhole);

}  // namespace v3d::recon
