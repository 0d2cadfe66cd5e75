// Measures rates by the wall clock. Google Benchmark itself uses the CPU time of the main thread,
// or adds
// "/real_time" to the fixed benchmark names.
#pragma once

#include <benchmark/benchmark.h>

#include <chrono>

namespace v3d::bench {

/// Runs `work` once per iteration and reports items and bytes per second of wall-clock time.
template <class Work>
void measure(benchmark::State& state, double items, double bytes, Work work) {
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : state) {
    work();
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  const double iterations = static_cast<double>(state.iterations());
  state.counters["items_per_second"] = items * iterations / elapsed.count();
  if (bytes > 0) {
    state.counters["bytes_per_second"] = bytes * iterations / elapsed.count();
  }
}

}  // namespace v3d::bench
