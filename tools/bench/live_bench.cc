#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <semaphore>
#include <string>

#include "base/core/statistics.h"
#include "base/core/time.h"
#include "rates.h"
#include "recon/hull/sparse_volume.h"
#include "recon/pipeline/frame_pipeline.h"
#include "recon/pipeline/frame_set_repair.h"
#include "workload.h"

namespace v3d::bench {
namespace {

/// One pulse in the pipeline, from 15 raw Bayer frames to one compact frame. The stages are those
/// of v3d-recond and `v3dctl reconstruct`.
struct Pulse {
  MonotonicInstant taken;
  recon::FrameSetJob work;
};

/// The live pipeline, fed with the same frames without a pause.
class Chain {
 public:
  Chain(const recon::ReconstructOptions& chosen, int threads)
      : segmenters_(make_segmenters()),
        reconstructor_(rig(), chosen),
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

  static std::vector<segmentation::Segmenter> make_segmenters() {
    std::vector<segmentation::Segmenter> segmenters;
    for (const segmentation::BackgroundModel& model : background_models()) {
      segmenters.emplace_back(model, segmentation::SegmentOptions{});
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

  std::vector<segmentation::Segmenter> segmenters_;
  recon::Reconstructor reconstructor_;
  std::atomic<bool> stopping_ = false;
  std::counting_semaphore<> done_{0};
  std::vector<double> latencies_ms_;      ///< of the last stage, until the pipeline has ended
  recon::FramePipeline<Pulse> pipeline_;  ///< last member: it uses all others
};

/// Maximum throughput of the pipeline, and its latency at this rate. Both stages are always busy,
/// and there is no queue before the first.
void live(benchmark::State& state, Quality quality, double voxel_m) {
  const int threads = static_cast<int>(state.range(0));
  recon::ReconstructOptions chosen = options(voxel_m, threads);
  chosen.quality = quality;
  Chain chain(chosen, threads);
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, 1, bytes, [&] { chain.wait_for_one(); });
  std::vector<double> latencies = chain.latencies_ms();
  state.counters["p50_ms"] = percentile(latencies, 0.50);
  state.counters["p99_ms"] = percentile(latencies, 0.99);
}

/// The faults that the repair of one pulse has to find.
enum class Silhouettes { kTrue, kWithHole };

/// frame_set(); with a fault, one camera has lost a band of its silhouette.
recon::FrameSet silhouettes(Silhouettes kind) {
  constexpr size_t kFaulty = 2;
  recon::FrameSet set = frame_set();
  if (kind == Silhouettes::kTrue) return set;
  Mask& mask = *set.frames[kFaulty].mask;
  const Rect box = mask.bounding_box();
  for (int y = box.y0 + box.height / 3; y < box.y0 + box.height / 2; ++y) {
    for (int x = box.x0; x < box.x0 + box.width; ++x) mask.set(x, y, false);
  }
  return set;
}

/// The live silhouette repair of a pulse. `steps`: the number of its leave-one-out hulls and slices
/// of voxels, which no load of the machine changes. `live_pulses`: its time, divided by that of the
/// reconstruction of the same pulse at live quality, in turn with it.
void repair(benchmark::State& state, Silhouettes kind) {
  const int threads = static_cast<int>(state.range(0));
  const recon::ReconstructOptions chosen = options(0.01, threads);
  tbb::task_arena arena(threads);
  recon::FrameSetRepair repair(rig(), chosen);
  recon::Reconstructor reconstructor(rig(), chosen);
  const recon::FrameSet given = silhouettes(kind);
  std::atomic<int64_t> steps = 0;
  std::vector<double> repairs_ms, pulses_ms;
  measure(state, 1, 0, [&] {
    recon::FrameSet set = given;
    steps = 0;
    const MonotonicInstant begin = Monotonic::now();
    arena.execute([&] { repair.repair(set, [&] { return ++steps < 0; }); });
    repairs_ms.push_back(recon::milliseconds_since(begin));
    const MonotonicInstant repaired = Monotonic::now();
    benchmark::DoNotOptimize(reconstructor.reconstruct(std::move(set)));
    pulses_ms.push_back(recon::milliseconds_since(repaired));
  });
  state.counters["steps"] = static_cast<double>(steps);
  state.counters["p50_ms"] = percentile(repairs_ms, 0.50);
  state.counters["live_pulses"] = percentile(repairs_ms, 0.50) / percentile(pulses_ms, 0.50);
}

BENCHMARK_CAPTURE(repair, true, Silhouettes::kTrue)
    ->Name("repair/10mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(repair, hole, Silhouettes::kWithHole)
    ->Name("repair_hole/10mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(live, hull, Quality::kLive, 0.01)
    ->Name("live/10mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(live, medium, Quality::kMedium, 0.01)
    ->Name("live_medium/10mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2);
BENCHMARK_CAPTURE(live, medium, Quality::kMedium, 0.008)
    ->Name("live_medium/8mm")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->Arg(4);

}  // namespace

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
    recon::Intersector hull = intersector(0.002);
    benchmark::DoNotOptimize(marching_cubes(hull.intersect(pointers)));
  });
  state.counters["peak_rss_mb"] = status_mb("VmHWM");
  state.counters["rise_mb"] = status_mb("VmHWM") - before;
}

BENCHMARK(memory)->Name("memory/2mm");

}  // namespace

}  // namespace v3d::bench
