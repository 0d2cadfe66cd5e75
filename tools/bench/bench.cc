// v3d-bench: runs the benchmarks with Google Benchmark. The sweep takes minutes and runs only when
// the filter names it (--benchmark_filter=^sweep/).
#include <benchmark/benchmark.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <map>
#include <string_view>
#include <thread>

#include "calib/rig/rig_fit.h"
#include "rates.h"
#include "recon/hull/sparse_volume.h"
#include "sim/cameras/board_walk.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {

// Benchmark sweep over resolutions, cameras and threads.

/// Adds sweep/intersect/voxel_mm:V/cameras:C/threads:T and sweep/mesh/voxel_mm:V/threads:T: voxels
/// of 2 to 20 mm before 15 cameras, 4 to 60 cameras at 8 mm, 1 thread to all cores. For
/// tools/bench/plot.
void register_sweep();

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

recon::Intersector intersector_of(const Silhouettes& seen, double voxel_m) {
  return {recon::VoxelGrid::covering(space(), voxel_m), seen.models, kMinViews};
}

void intersect(benchmark::State& state) {
  const Silhouettes& seen = silhouettes(static_cast<int>(state.range(1)));
  recon::Intersector hull = intersector_of(seen, 0.001 * static_cast<double>(state.range(0)));
  const std::vector<const Mask*> pointers = pointers_to(seen.masks);
  tbb::task_arena arena(static_cast<int>(state.range(2)));
  recon::SparseVolume volume;
  measure(state, 1, 0, [&] {
    arena.execute([&] { hull.intersect(pointers, volume); });
    benchmark::DoNotOptimize(volume);
  });
}

void mesh(benchmark::State& state) {
  const recon::SparseVolume occupied = volume(0.001 * static_cast<double>(state.range(0)));
  tbb::task_arena arena(static_cast<int>(state.range(1)));
  recon::MarchingCubes marching_cubes;
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

namespace {

/// Observations of a board moved through a simulated rig, with corner noise of 0.2 px.
std::vector<calib::CameraObservations> walk(const calib::Board& board, int cameras) {
  const Rig rig = sim::make_rig(cameras, {1024, 768}, 3);
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < board.corners(); ++i) corners.push_back(board.corner(i));
  std::vector<calib::CameraObservations> seen;
  for (const RigCamera& c : rig) seen.push_back({c.name, c.model.size(), {}});
  sim::BoardWalkOptions options;
  options.boards = 400;
  for (const sim::ObservedCorner& s : sim::walk_board(rig, corners, options).corners) {
    calib::BoardObservation& observation = seen[s.camera].observations[s.board];
    observation.corners.push_back(s.corner);
    observation.pixels.push_back(s.pixel);
  }
  return seen;
}

/// Fits the lenses and poses of a whole rig to observations.
void calibrate(benchmark::State& state) {
  const calib::Board board = calib::parse_board("chess:9x6:100mm");
  const auto seen = walk(board, static_cast<int>(state.range(0)));
  double rms = 0;
  for (auto _ : state) rms = fit_rig(board, seen, {}).rms_px;
  state.counters["rms_px"] = rms;
}
BENCHMARK(calibrate)
    ->Name("calibrate")
    ->ArgName("cameras")
    ->Arg(15)
    ->Arg(60)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->UseRealTime();

}  // namespace

}  // namespace v3d::bench

namespace {

bool asks_for_sweep(std::string_view argument) {
  return argument.starts_with("--benchmark_filter=") && argument.find("sweep") != argument.npos;
}

}  // namespace

int main(int argc, char** argv) {
  if (std::any_of(argv + 1, argv + argc, asks_for_sweep)) {
    v3d::bench::register_sweep();
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
