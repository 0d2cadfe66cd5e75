#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// 15 raw Bayer frames to one compact frame, all stages.
void live(benchmark::State& state) {
  const int threads = static_cast<int>(state.range(0));
  std::vector<Segmenter> segmenters;
  for (const BackgroundModel& model : background_models()) {
    segmenters.emplace_back(model, SegmentOptions{});
  }
  const std::vector<Image>& frames = raw_frames();
  Reconstructor reconstructor(rig(), options(0.01, threads));
  FrameSet set;
  set.frames.resize(kCameras);
  tbb::task_arena arena(threads);
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, 1, bytes, [&] {
    arena.execute([&] {
      tbb::parallel_for(0, kCameras, [&](int c) {
        const ImageView raw = frames[c].view();
        set.frames[c] = observe(rig()[c].name, {}, raw, segmenters[c].segment(raw));
      });
    });
    benchmark::DoNotOptimize(reconstructor.reconstruct(set).compact);
  });
}

BENCHMARK(live)->Name("live/10mm")->ArgName("threads")->Arg(1)->Arg(2);

}  // namespace
}  // namespace v3d::bench
