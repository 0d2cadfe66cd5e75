// COLMAP's text model: cameras.txt (lenses) and images.txt (poses).
// Conventions: as base/camera_model.h, but for pixels: (0.5, 0.5) is the centre of the first one,
// so the principal point is half a pixel more. Unit and direction of the world are arbitrary.
// Source: colmap.github.io/format.html, colmap.github.io/cameras.html
#pragma once

#include <filesystem>
#include <string>

#include "base/camera_model.h"

namespace v3d::calib {

struct ColmapText {
  std::string cameras;  ///< cameras.txt
  std::string images;   ///< images.txt
};

/// A camera of the rig for every image, in their order, named after its file, or after its folder
/// where only that differs. Lenses: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and
/// FULL_OPENCV. Throws InputError with file and line; other lenses (fisheye, FOV, thin prism) are
/// refused by name. `folder` is where the files are, for messages.
Rig parse_colmap(const ColmapText& text, const std::filesystem::path& folder);

/// The rig as parse_colmap() reads it, images named NAME.png, no points. Throws InputError that
/// names a camera whose lens COLMAP has no model for: skew, thin prism, tilted sensor.
ColmapText colmap_text(const Rig& rig);

}  // namespace v3d::calib
