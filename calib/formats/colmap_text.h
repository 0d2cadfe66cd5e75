// COLMAP's text model: cameras.txt (lenses) and images.txt (poses).
//
// Conventions are those of base/geometry/camera_model.h except for pixels: (0.5, 0.5) is the centre
// of the first pixel, so the principal point is larger by half a pixel. Unit and orientation of the
// world are arbitrary. Source: colmap.github.io/format.html, colmap.github.io/cameras.html
#pragma once

#include <filesystem>
#include <string>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

struct ColmapText {
  std::string cameras;  ///< cameras.txt
  std::string images;   ///< images.txt
};

/// Reads one camera for each image, in the order of the images.
///
/// A camera has the name of its image file, or of the folder where only the folders differ. Lens
/// models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV. `folder`:
/// location of the files, for messages. Throws InputError with file and line; the message names an
/// unsupported lens model.
Rig parse_colmap(const ColmapText& text, const std::filesystem::path& folder);

/// Writes the rig in the form that parse_colmap() reads, with images named NAME.png and no points.
/// Throws InputError with the name of a camera whose lens COLMAP cannot express: skew, thin prism,
/// tilted sensor.
ColmapText colmap_text(const Rig& rig);

}  // namespace v3d::calib
