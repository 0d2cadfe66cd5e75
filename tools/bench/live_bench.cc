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

/// One pulse in the pipeline, from 15 raw Bayer frames to one compact frame. The stages are those
/// of v3d-recond and `v3dctl reconstruct`.
struct Pulse {
  MonotonicInstant taken;
  FrameSetJob work;
};

/// The live pipeline, fed with the same frames without a pause.
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
  /// Stops the pipeline. Returns the latencies from raw frames to compact frame, milliseconds.
  std::vector<double> latencies_ms() {
    stopping_ = true;
    pipeline_.wait();
    return latencies_ms_;
  }

 private:
  /// Frames are available at once, so there is no queue before the pipeline.
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
  FramePipeline<Pulse> pipeline_;     ///< last member: it uses all others
};

/// Maximum throughput of the pipeline, and its latency at this rate. Both stages are always busy,
/// and there is no queue before the first.
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
