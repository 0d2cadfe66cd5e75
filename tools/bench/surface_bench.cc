#include <tbb/task_arena.h>

#include "rates.h"
#include "recon/metrics/frame_quality.h"
#include "recon/texture/texture.h"
#include "recon/visibility/depth_buffer.h"
#include "workload.h"

namespace v3d::bench {
namespace {

const Mesh& mesh_10mm() {
  static const Mesh kMesh = Reconstructor(rig(), options(0.01, 0)).reconstruct(frame_set()).mesh;
  return kMesh;
}

void texture(benchmark::State& state, int threads) {
  std::vector<TextureCamera> cameras;
  for (int c = 0; c < kCameras; ++c) {
    cameras.push_back({&rig()[c].model, &frame_set().frames[c]});
  }
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(threads);
  measure(state, 1, 0, [&] {
    arena.execute([&] { benchmark::DoNotOptimize(colour_vertices(mesh, cameras, {})); });
  });
}

/// Measures the quality of a mesh against the silhouettes it was made from.
void score(benchmark::State& state) {
  const QualityMeter meter(rig(), options(0.01, 0).bounds, 0.01);
  std::vector<const Frame*> frames;
  for (const Frame& frame : frame_set().frames) frames.push_back(&frame);
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(1);
  FrameQuality quality;
  measure(state, 1, 0, [&] { arena.execute([&] { quality = meter.measure(mesh, frames); }); });
  state.counters["iou"] = quality.silhouette_iou;
  state.counters["coverage"] = quality.coverage;
}

/// Draws the depth buffers of the whole rig, reduced by `factor`.
void raster(benchmark::State& state, int factor) {
  std::vector<CameraModel> models;
  for (const CameraModel& camera : models_of(rig())) models.push_back(camera.reduced(factor));
  const Mesh& mesh = mesh_10mm();
  tbb::task_arena arena(1);
  std::vector<DepthBuffer> buffers;
  measure(state, kCameras, 0, [&] {
    arena.execute([&] { draw_depths(mesh, models, buffers); });
    benchmark::DoNotOptimize(buffers.data());
  });
}

BENCHMARK_CAPTURE(texture, one, 1)->Name("texture/10mm");
BENCHMARK_CAPTURE(texture, two, 2)->Name("texture/10mm/threads:2");
BENCHMARK(score)->Name("score/10mm");
BENCHMARK_CAPTURE(raster, whole, 1)->Name("raster/depth_15xXGA");
BENCHMARK_CAPTURE(raster, half, 2)->Name("raster/depth_15xXGA/half");
BENCHMARK_CAPTURE(raster, quarter, 4)->Name("raster/depth_15xXGA/quarter");

}  // namespace
}  // namespace v3d::bench
