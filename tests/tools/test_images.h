// Small recordings to import: a rig, images, masks and videos as files.
#pragma once

#include <filesystem>
#include <string>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"

namespace v3d::test {

/// Cameras a, b, ... of 64x48 on a circle of 2 m that look at the origin.
Rig small_rig(int cameras);

/// A ball of 0.3 m at the origin, bright on black, as the camera sees it.
Image ball_image(const RigCamera& camera);
/// Its silhouette, 0 and 255 in three channels.
Image ball_mask(const RigCamera& camera);

/// A video (Motion JPEG, AVI) of `frames` grey pictures of the size, each a little
/// brighter than the one before.
void write_video(const std::filesystem::path& path, ImageSize size, int frames,
                 double rate_hz = 10);

/// DIR/a.png, DIR/b.png, ... of what `draw` gives.
void write_pictures(const std::filesystem::path& folder, const Rig& rig,
                    Image (*draw)(const RigCamera&));

void write_jpeg(const std::filesystem::path& path, const Image& rgb);

/// Cuts the end of a file off: `keep` of its bytes stay, 0..1.
void truncate_file(const std::filesystem::path& path, double keep);

}  // namespace v3d::test
