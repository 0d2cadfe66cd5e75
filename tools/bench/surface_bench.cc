#include <tbb/task_arena.h>

#include "rates.h"
#include "recon/depth_raster.h"
#include "recon/texture.h"
#include "workload.h"

namespace v3d::bench {
namespace {

const Mesh& mesh_10mm() {
  static const Mesh kMesh = Reconstructor(rig(), options(0.01, 0)).reconstruct(frame_set()).mesh;
  return kMesh;
}

void texture(benchmark::State& state) {
  std::vector<TextureCamera> cameras;
  for (int c = 0; c < kCameras; ++c) {
    cameras.push_back({&rig()[c].model, &frame_set().frames[c]});
  }
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(1);
  measure(state, 1, 0, [&] {
    arena.execute([&] { benchmark::DoNotOptimize(colour_vertices(mesh, cameras, {})); });
  });
}

/// The depth buffers of the whole rig at full size.
void raster(benchmark::State& state) {
  std::vector<CameraModel> models;
  for (const RigCamera& camera : rig()) {
    models.push_back(camera.model);
  }
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(1);
  measure(state, kCameras, 0,
          [&] { arena.execute([&] { benchmark::DoNotOptimize(draw_depths(mesh, models)); }); });
}

BENCHMARK(texture)->Name("texture/10mm");
BENCHMARK(raster)->Name("raster/depth_15xXGA");

}  // namespace
}  // namespace v3d::bench
