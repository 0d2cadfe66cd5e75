#include <tbb/task_arena.h>

#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

void encode(benchmark::State& state, int threads) {
  const CompactFrame& frame = compact_frame_10mm();
  tbb::task_arena arena(threads);
  measure(state, 1, static_cast<double>(compact_10mm().size()),
          [&] { arena.execute([&] { benchmark::DoNotOptimize(encode_compact(frame)); }); });
  state.counters["frame_bytes"] = static_cast<double>(compact_10mm().size());
}

void decode(benchmark::State& state) {
  measure(state, 1, static_cast<double>(compact_10mm().size()),
          [&] { benchmark::DoNotOptimize(decode_compact(compact_10mm())); });
}

BENCHMARK_CAPTURE(encode, one, 1)->Name("encode/10mm");
BENCHMARK_CAPTURE(encode, two, 2)->Name("encode/10mm/threads:2");
BENCHMARK(decode)->Name("decode/10mm");

}  // namespace
}  // namespace v3d::bench
