#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <semaphore>

#include "base/core/statistics.h"
#include "base/core/time.h"
#include "rates.h"
#include "recon/pipeline/frame_pipeline.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// One pulse: 15 raw Bayer frames to one compact frame, all stages, as v3d-recond and `v3dctl
/// reconstruct` run them.
struct Pulse {
  MonotonicInstant taken;
  FrameSetJob work;
};

class Chain {
 public:
  explicit Chain(int threads)
      : segmenters_(make_segmenters()),
        reconstructor_(rig(), options(0.01, threads)),
        pipeline_(
            threads, [this] { return next(); },
            {[this](Pulse& pulse) { make_mesh(pulse); }, [this](Pulse& pulse) { encode(pulse); }}) {
  }
  ~Chain() { latencies_ms(); }

  void wait_for_one() { done_.acquire(); }
  /// Ends the chain; from frames taken to compact frame made, milliseconds.
  std::vector<double> latencies_ms() {
    stopping_ = true;
    pipeline_.wait();
    return latencies_ms_;
  }

 private:
  /// The next frames are there as soon as the pipeline wants them: nothing waits before it.
  std::optional<Pulse> next() {
    if (stopping_) return std::nullopt;
    return Pulse{Monotonic::now(), {}};
  }

  static std::vector<Segmenter> make_segmenters() {
    std::vector<Segmenter> segmenters;
    for (const BackgroundModel& model : background_models()) {
      segmenters.emplace_back(model, SegmentOptions{});
    }
    return segmenters;
  }

  void make_mesh(Pulse& pulse) {
    std::vector<Frame>& frames = pulse.work.set.frames;
    frames.resize(kCameras);
    tbb::parallel_for(0, kCameras, [&](int c) {
      const ImageView raw = raw_frames()[c].view();
      frames[c] = observe(rig()[c].name, {}, raw, segmenters_[c].segment(raw));
    });
    reconstructor_.make_mesh(pulse.work);
  }

  void encode(Pulse& pulse) {
    reconstructor_.encode(pulse.work);
    benchmark::DoNotOptimize(pulse.work.result.compact);
    latencies_ms_.push_back(1e3 * to_seconds(Monotonic::now() - pulse.taken));
    done_.release();
  }

  std::vector<Segmenter> segmenters_;
  Reconstructor reconstructor_;
  std::atomic<bool> stopping_ = false;
  std::counting_semaphore<> done_{0};
  std::vector<double> latencies_ms_;  ///< of the last stage, until the pipeline has ended
  FramePipeline<Pulse> pipeline_;     ///< last: it works with all of the above
};

/// Frames are handed in as soon as the pipeline takes them, so both of its stages are always busy:
/// that is the most frames it can do, and the latency at that rate, without any queue before it.
void live(benchmark::State& state) {
  Chain chain(static_cast<int>(state.range(0)));
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, 1, bytes, [&] { chain.wait_for_one(); });
  std::vector<double> latencies = chain.latencies_ms();
  state.counters["p50_ms"] = percentile(latencies, 0.50);
  state.counters["p99_ms"] = percentile(latencies, 0.99);
}

BENCHMARK(live)->Name("live/10mm")->ArgName("threads")->Arg(1)->Arg(2);

}  // namespace
}  // namespace v3d::bench
