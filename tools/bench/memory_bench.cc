#include <fstream>
#include <string>

#include "rates.h"
#include "recon/hull/marching_cubes.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// A size of /proc/self/status ("VmRSS", "VmHWM") in megabytes; 0 when it is missing.
double status_mb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key + ":")) return std::stod(line.substr(key.size() + 1)) / 1000;
  }
  return 0;
}

/// Resets the peak of the resident memory (VmHWM): see proc(5), clear_refs.
void reset_peak() { std::ofstream("/proc/self/clear_refs") << 5; }

/// Memory to make a mesh at 2 mm from silhouettes. `peak_rss_mb` is the peak of the whole process,
/// including the workload of the benchmark; `rise_mb` is the increase by this work.
void memory(benchmark::State& state) {
  const std::vector<const Mask*> pointers = pointers_to(masks());
  const double before = status_mb("VmRSS");
  reset_peak();
  measure(state, 1, 0, [&] {
    Intersector hull = intersector(0.002);
    benchmark::DoNotOptimize(marching_cubes(hull.intersect(pointers)));
  });
  state.counters["peak_rss_mb"] = status_mb("VmHWM");
  state.counters["rise_mb"] = status_mb("VmHWM") - before;
}

BENCHMARK(memory)->Name("memory/2mm");

}  // namespace
}  // namespace v3d::bench
