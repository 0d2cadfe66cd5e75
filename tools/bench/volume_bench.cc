#include <tbb/task_arena.h>

#include "rates.h"
#include "recon/hull/ghost_removal.h"
#include "recon/hull/marching_cubes.h"
#include "workload.h"

namespace v3d::bench {
namespace {

void intersect(benchmark::State& state, double voxel_m) {
  Intersector hull = intersector(voxel_m);
  const std::vector<const Mask*> pointers = pointers_to(masks());
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  SparseVolume volume;
  measure(state, 1, 0, [&] {
    arena.execute([&] { hull.intersect(pointers, volume); });
    benchmark::DoNotOptimize(volume);
  });
}

/// A hull without ghosts: only its components are searched.
void remove_ghosts(benchmark::State& state, double voxel_m) {
  SparseVolume hull = volume(voxel_m);
  const std::vector<CameraModel> cameras = models_of(rig());
  GhostRemoval ghosts(hull.grid(), cameras);
  const std::vector<uint8_t> takes_part(cameras.size(), 1);
  ghosts.remove(hull, takes_part);
  measure(state, 1, 0, [&] { benchmark::DoNotOptimize(ghosts.remove(hull, takes_part)); });
}

void mesh(benchmark::State& state, double voxel_m) {
  const SparseVolume occupied = volume(voxel_m);
  tbb::task_arena arena(1);
  MarchingCubes marching_cubes;
  Mesh surface;
  measure(state, 1, 0, [&] {
    arena.execute([&] { marching_cubes.run(occupied, surface); });
    benchmark::DoNotOptimize(surface.triangles.data());
  });
}

BENCHMARK_CAPTURE(intersect, 16mm, 0.016)
    ->Name("intersect/16mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(intersect, 4mm, 0.004)->Name("intersect/4mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(intersect, 8mm, 0.008)->Name("intersect/8mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(intersect, 5mm, 0.005)->Name("intersect/5mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(intersect, 2mm, 0.002)->Name("intersect/2mm")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK_CAPTURE(remove_ghosts, 10mm, 0.01)->Name("remove_ghosts/10mm");
BENCHMARK_CAPTURE(remove_ghosts, 5mm, 0.005)->Name("remove_ghosts/5mm");
BENCHMARK_CAPTURE(mesh, 8mm, 0.008)->Name("mesh/8mm");
BENCHMARK_CAPTURE(mesh, 5mm, 0.005)->Name("mesh/5mm");

}  // namespace
}  // namespace v3d::bench
