// write_image_folder FOLDER: writes images, masks and calibration of the simulated performer as
// FOLDER/images/CAMERA.png, FOLDER/masks/CAMERA.png and FOLDER/calib.toml, and a compact frame of
// them as FOLDER/frame. Prints what examples/decode_frame prints of that frame.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "base/config/calib_file.h"
#include "base/image/image_files.h"
#include "base/image/mask.h"
#include "recon/pipeline/reconstructor.h"
#include "sim/rendering/scene.h"

int main(int, char** argv) {
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder / "images");
  std::filesystem::create_directories(folder / "masks");
  const v3d::Rig rig = v3d::sim::make_rig(8, {640, 480}, 1);
  v3d::recon::FrameSet set;
  set.pulse = 7;
  for (const v3d::RigCamera& camera : rig) {
    const v3d::Image image = v3d::sim::render(camera, 0.5, true, 0, {});
    const v3d::Mask mask = v3d::sim::true_silhouette(camera, 0.5, 1);
    v3d::write_png(folder / "images" / (camera.name + ".png"), image.view());
    v3d::write_png(folder / "masks" / (camera.name + ".png"), v3d::image_from_mask(mask).view());
    set.frames.push_back(v3d::observe(camera.name, {}, image.view(), mask));
  }
  v3d::save_calib(folder / "calib.toml", rig);

  const v3d::recon::ReconstructOptions coarse{.bounds = {{-1, -1, 0}, {1, 1, 2}}, .voxel_m = 0.04};
  const v3d::recon::Reconstruction result =
      v3d::recon::Reconstructor(rig, coarse).reconstruct(std::move(set));
  std::ofstream(folder / "frame")
      .write(reinterpret_cast<const char*>(result.compact.data()),
             static_cast<std::streamsize>(result.compact.size()));
  std::printf("pulse %lld: %zu vertices, %zu triangles\n", static_cast<long long>(result.pulse),
              result.mesh.vertices.size(), result.mesh.triangles.size());
}
