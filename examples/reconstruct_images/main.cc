// Reconstructs a mesh from FOLDER/calib.toml, FOLDER/images/CAMERA.png and FOLDER/masks/CAMERA.png.
#include <base/config/calib_file.h>
#include <base/image/image_files.h>
#include <recon/pipeline/stages.h>

#include <fstream>
#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 3) throw std::invalid_argument("usage: reconstruct_images FOLDER OUT.obj");
  const std::filesystem::path folder = argv[1];
  const v3d::Rig rig = v3d::load_calib(folder / "calib.toml");
  v3d::recon::FrameSet set;
  for (const v3d::RigCamera& camera : rig) {
    const v3d::Image image = v3d::read_picture(folder / "images" / (camera.name + ".png"));
    const v3d::Image mask = v3d::read_picture(folder / "masks" / (camera.name + ".png"));
    set.frames.push_back(observe(camera.name, {}, image.view(), mask_from_picture(mask)));
  }
  const v3d::recon::RigFrames frames = usable_frames(rig, set);

  const v3d::Box bounds{{-1.5, -1.5, 0}, {1.5, 1.5, 2}};  // metres
  const double voxel_m = 0.01;
  v3d::recon::HullStage hulls(rig, bounds, voxel_m, /*min_views=*/4);
  v3d::recon::Hull hull = hulls.intersect(frames);
  v3d::Mesh mesh = hulls.surface(hull.volume);
  v3d::recon::DeformStage(rig, hulls.grid(), {}).deform(frames, hull.volume, mesh);
  colour_surface(rig, frames, voxel_m, v3d::recon::ColourDetail::kFull, mesh);

  std::ofstream out(argv[2]);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto [r, g, b] = mesh.colours[v];
    out << "v " << mesh.vertices[v].transpose() << ' ' << r / 255.0 << ' ' << g / 255.0 << ' '
        << b / 255.0 << '\n';
  }
  for (auto [a, b, c] : mesh.triangles) out << "f " << ++a << ' ' << ++b << ' ' << ++c << '\n';
  return out.flush() ? 0 : 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
