#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "capture/sync/pulse_matcher.h"
#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// Segments 15 raw frames into 15 masks.
void segment(benchmark::State& state) {
  std::vector<Segmenter> segmenters;
  for (const BackgroundModel& model : background_models()) {
    segmenters.emplace_back(model, SegmentOptions{});
  }
  const std::vector<Image>& frames = raw_frames();
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, kCameras, bytes, [&] {
    arena.execute([&] {
      tbb::parallel_for(0, kCameras, [&](int c) {
        benchmark::DoNotOptimize(segmenters[c].segment(frames[c].view()));
      });
    });
  });
}

/// Assigns pulses to the frames of a camera at 25 Hz whose clock is 100 ppm fast.
void match(benchmark::State& state) {
  const Duration period = period_of(25);
  const auto device_period = static_cast<int64_t>(static_cast<double>(period.count()) * 1.0001);
  PulseMatcher matcher(period);
  int64_t frame = 0;
  measure(state, 1, 0, [&] {
    benchmark::DoNotOptimize(
        matcher.label({from_ns<DeviceClock>(frame * device_period), static_cast<uint64_t>(frame),
                       from_ns<Monotonic>(frame * period.count())}));
    ++frame;
  });
}

BENCHMARK(segment)->Name("segment/15xXGA")->ArgName("threads")->Arg(1)->Arg(2);
BENCHMARK(match)->Name("match/frames");

}  // namespace
}  // namespace v3d::bench
