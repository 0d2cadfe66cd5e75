#include "sweep_bench.h"

#include <tbb/task_arena.h>

#include <map>
#include <thread>

#include "rates.h"
#include "recon/hull/marching_cubes.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr int kMillimetres[] = {2, 3, 4, 5, 6, 8, 10, 12, 16, 20};
constexpr int kCameraCounts[] = {4, 6, 8, 10, 12, 15, 20, 30, 45, 60};
constexpr int kUsualMillimetres = 8;
constexpr double kInstantSeconds = 1.5;

struct Silhouettes {
  std::vector<CameraModel> models;
  std::vector<Mask> masks;
};

/// Silhouettes of the benchmark's 15 cameras are segmented; those of other rigs are exact, because
/// rendering plates for 60 cameras takes minutes.
Silhouettes make_silhouettes(int cameras) {
  if (cameras == kCameras) return {models_of(rig()), masks()};
  const Rig others = sim::make_rig(cameras, kSize, kSeed);
  Silhouettes made{models_of(others), {}};
  for (const RigCamera& camera : others) {
    made.masks.push_back(sim::true_silhouette(camera, kInstantSeconds, kSeed));
  }
  return made;
}

const Silhouettes& silhouettes(int cameras) {
  static std::map<int, Silhouettes> made;
  const auto found = made.find(cameras);
  if (found != made.end()) return found->second;
  return made.emplace(cameras, make_silhouettes(cameras)).first->second;
}

Intersector intersector_of(const Silhouettes& seen, double voxel_m) {
  return {VoxelGrid::covering(space(), voxel_m), seen.models, kMinViews};
}

void intersect(benchmark::State& state) {
  const Silhouettes& seen = silhouettes(static_cast<int>(state.range(1)));
  Intersector hull = intersector_of(seen, 0.001 * static_cast<double>(state.range(0)));
  const std::vector<const Mask*> pointers = pointers_to(seen.masks);
  tbb::task_arena arena(static_cast<int>(state.range(2)));
  SparseVolume volume;
  measure(state, 1, 0, [&] {
    arena.execute([&] { hull.intersect(pointers, volume); });
    benchmark::DoNotOptimize(volume);
  });
}

void mesh(benchmark::State& state) {
  const SparseVolume occupied = volume(0.001 * static_cast<double>(state.range(0)));
  tbb::task_arena arena(static_cast<int>(state.range(1)));
  MarchingCubes marching_cubes;
  Mesh surface;
  measure(state, 1, 0, [&] {
    arena.execute([&] { marching_cubes.run(occupied, surface); });
    benchmark::DoNotOptimize(surface.triangles.data());
  });
}

/// 1, 2, 4, ... and the number of cores.
std::vector<int64_t> thread_counts() {
  const int64_t cores = std::max(1U, std::thread::hardware_concurrency());
  std::vector<int64_t> counts;
  for (int64_t n = 1; n < cores; n *= 2) counts.push_back(n);
  counts.push_back(cores);
  return counts;
}

}  // namespace

void register_sweep() {
  auto* intersections = benchmark::RegisterBenchmark("sweep/intersect", intersect)
                            ->ArgNames({"voxel_mm", "cameras", "threads"});
  auto* meshes =
      benchmark::RegisterBenchmark("sweep/mesh", mesh)->ArgNames({"voxel_mm", "threads"});
  for (const int64_t threads : thread_counts()) {
    for (const int voxel_mm : kMillimetres) {
      intersections->Args({voxel_mm, kCameras, threads});
      meshes->Args({voxel_mm, threads});
    }
    for (const int cameras : kCameraCounts) {
      if (cameras != kCameras) intersections->Args({kUsualMillimetres, cameras, threads});
    }
  }
}

}  // namespace v3d::bench
