// Reeb graphs and their similarity. The surface is the visual hull of the simulated performer.
#include <benchmark/benchmark.h>
#include <tbb/task_arena.h>

#include "rates.h"
#include "recon/skeleton/graph_similarity.h"
#include "workload.h"

namespace v3d::bench {
namespace {

Mesh hull(double voxel_m) { return recon::marching_cubes(volume(voxel_m)); }

void reeb_graph(benchmark::State& state, double voxel_m) {
  const Mesh mesh = hull(voxel_m);
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  measure(state, 1, 0,
          [&] { arena.execute([&] { benchmark::DoNotOptimize(recon::reeb_graph(mesh)); }); });
  state.counters["vertices"] = static_cast<double>(mesh.vertices.size());
}

void graph_similarity(benchmark::State& state) {
  const recon::ReebGraph a = recon::reeb_graph(hull(0.016)), b = recon::reeb_graph(hull(0.02));
  measure(state, 1, 0, [&] { benchmark::DoNotOptimize(recon::graph_similarity(a, b)); });
}

BENCHMARK_CAPTURE(reeb_graph, 16mm, 0.016)
    ->Name("reeb_graph/16mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(reeb_graph, 8mm, 0.008)->Name("reeb_graph/8mm")->ArgName("threads")->Arg(2);
BENCHMARK(graph_similarity)->Name("graph_similarity/16mm");

}  // namespace
}  // namespace v3d::bench
