#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "rates.h"
#include "recon/hull/marching_cubes.h"
#include "recon/surface/deform.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr double kVoxelM = 0.005;

std::vector<DeformCamera> deform_cameras() {
  std::vector<DeformCamera> cameras;
  for (int c = 0; c < kCameras; ++c) cameras.push_back({&rig()[c].model, &frame_set().frames[c]});
  return cameras;
}

void deform(benchmark::State& state, int threads) {
  const std::vector<DeformCamera> cameras = deform_cameras();
  const Mesh hull = marching_cubes(volume(kVoxelM));
  Deformer deformer({.voxel_m = kVoxelM});
  tbb::task_arena arena(threads);
  Mesh mesh;
  measure(state, 1, 0, [&] {
    mesh = hull;
    arena.execute([&] { deformer.run(SurfaceCameras(cameras, mesh, kVoxelM), mesh); });
    benchmark::DoNotOptimize(mesh.vertices.data());
  });
  state.counters["vertices"] = static_cast<double>(hull.vertices.size());
}

/// All stages from 15 raw Bayer frames to one compact frame, without a pipeline.
void high(benchmark::State& state) {
  const int threads = static_cast<int>(state.range(0));
  std::vector<Segmenter> segmenters;
  for (const BackgroundModel& model : background_models()) {
    segmenters.emplace_back(model, SegmentOptions{});
  }
  ReconstructOptions chosen = options(kVoxelM, threads);
  chosen.quality = Quality::kHigh;
  Reconstructor reconstructor(rig(), chosen);
  tbb::task_arena arena(threads);
  measure(state, 1, static_cast<double>(kSize.pixels()) * kCameras, [&] {
    FrameSet set;
    set.frames.resize(kCameras);
    arena.execute([&] {
      tbb::parallel_for(0, kCameras, [&](int c) {
        const ImageView raw = raw_frames()[c].view();
        set.frames[c] = observe(rig()[c].name, {}, raw, segmenters[c].segment(raw));
      });
    });
    benchmark::DoNotOptimize(reconstructor.reconstruct(std::move(set)).compact);
  });
}

BENCHMARK_CAPTURE(deform, one, 1)->Name("deform/5mm")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(deform, two, 2)->Name("deform/5mm/threads:2")->Unit(benchmark::kMillisecond);
BENCHMARK(high)
    ->Name("high/5mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace v3d::bench
