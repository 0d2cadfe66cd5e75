// v3d-bench: runs the benchmarks with Google Benchmark. The sweep takes minutes and runs only when
// the filter names it (--benchmark_filter=^sweep/).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <string_view>

#include "sweep_bench.h"

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
