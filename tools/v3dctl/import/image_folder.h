// A folder of pictures, one camera each (CAM.png) or a folder per camera (CAM/000012.png).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/camera_model.h"

namespace v3d::ctl {

/// The pictures of one camera in the order of time; masks[i] belongs to images[i].
struct ImageSequence {
  std::string camera;
  std::vector<std::filesystem::path> images;
  std::vector<std::filesystem::path> masks;  ///< empty, or as many as images
};

/// The sequences in `images` in the order of the rig, cameras without pictures left out. Other
/// files than pictures are passed over. Pictures of a sequence are ordered by name, numbers in a
/// name by value; their names must be the same for every camera. Throws InputError: a picture that
/// belongs to no camera of the rig, a camera with two kinds of pictures, sequences of different
/// frames, a mask without picture or picture without mask, no pictures at all. `masks` empty: none.
std::vector<ImageSequence> find_images(const std::filesystem::path& images,
                                       const std::filesystem::path& masks, const Rig& rig);

/// Pictures in `folder` itself, ordered as above.
std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);

}  // namespace v3d::ctl
