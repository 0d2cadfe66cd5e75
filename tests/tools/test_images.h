// Small recordings for import tests: a rig, images, masks and videos as files.
#pragma once

#include <filesystem>
#include <string>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"

namespace v3d::test {

/// Cameras a, b, ... of 64x48 on a circle of 2 m that look at the origin.
Rig small_rig(int cameras);

/// The camera's image of a ball of 0.3 m at the origin, bright on black.
Image ball_image(const RigCamera& camera);
/// Its silhouette, 0 and 255 in three channels.
Image ball_mask(const RigCamera& camera);

/// Writes a video (Motion JPEG, AVI) of `frames` grey pictures of the size, each a little brighter
/// than the previous one.
void write_video(const std::filesystem::path& path, ImageSize size, int frames,
                 double rate_hz = 10);

/// Writes DIR/a.png, DIR/b.png, ... with the images that `draw` returns.
void write_pictures(const std::filesystem::path& folder, const Rig& rig,
                    Image (*draw)(const RigCamera&));

void write_jpeg(const std::filesystem::path& path, const Image& rgb);

/// Truncates a file to the part `keep` of its bytes, 0 to 1.
void truncate_file(const std::filesystem::path& path, double keep);

}  // namespace v3d::test
