#include <tbb/task_arena.h>

#include "rates.h"
#include "recon/compact_frame.h"
#include "workload.h"

namespace v3d::bench {
namespace {

const std::vector<uint8_t>& compact_10mm() {
  static const std::vector<uint8_t> kCompact =
      Reconstructor(rig(), options(0.01, 0)).reconstruct(frame_set()).compact;
  return kCompact;
}

void encode(benchmark::State& state, int threads) {
  const auto frame = decode_compact(compact_10mm());
  tbb::task_arena arena(threads);
  measure(state, 1, static_cast<double>(compact_10mm().size()),
          [&] { arena.execute([&] { benchmark::DoNotOptimize(encode_compact(*frame)); }); });
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
