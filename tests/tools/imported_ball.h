// A take of a ball that was imported from images, for tests of what follows.
#pragma once

#include <filesystem>

#include "base/config/calib_file.h"
#include "tools/test_images.h"
#include "v3dctl/import/import.h"

namespace v3d::test {

/// Writes the calibration, images and masks of a ball in this many cameras below `folder`, and
/// imports them as `take`.
inline void import_ball(const std::filesystem::path& folder, int cameras,
                        const std::filesystem::path& take) {
  const Rig rig = small_rig(cameras);
  save_calib(folder / "calib.toml", rig);
  write_pictures(folder / "images", rig, ball_image);
  write_pictures(folder / "masks", rig, ball_mask);
  ctl::ImportOptions import;
  import.take = take;
  import.calib = folder / "calib.toml";
  import.images = folder / "images";
  import.masks = folder / "masks";
  ctl::import_take(import);
}

}  // namespace v3d::test
