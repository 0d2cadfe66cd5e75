#include "v3dctl/motion/sharded_tracking.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/time.h"
#include "common/console.h"
#include "v3dctl/motion/motion_file.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/sharded_work.h"

namespace v3d::ctl {
namespace {

/// Runs `work` on so many threads.
template <class Work>
auto with_threads(int threads, const Work& work) {
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism,
                                    static_cast<size_t>(threads));
  tbb::task_arena arena(threads);
  return arena.execute(work);
}

/// Of the surveyed pulses that a segment covers.
recon::SegmentExtent extent_of(const TrackedSegmentReport& segment,
                               const std::vector<int64_t>& pulses) {
  const auto first = std::ranges::lower_bound(pulses, segment.first) - pulses.begin();
  return {static_cast<size_t>(first), static_cast<size_t>(first + segment.pulses)};
}

bool is_within(const recon::SegmentExtent& extent, const recon::SegmentRange& range) {
  return range.first <= extent.from && extent.from < extent.to && extent.to <= range.last;
}

take::FrameRange shard_of(const recon::SegmentRange& range) {
  return {static_cast<int64_t>(range.first), static_cast<int64_t>(range.last)};
}

/// The range of a take with these indices of pulses.
std::optional<recon::SegmentRange> range_of(const take::FrameRange& shard,
                                            const recon::TakeSurvey& survey) {
  const auto first = static_cast<size_t>(shard.begin), last = static_cast<size_t>(shard.end);
  for (const recon::SegmentRange& interval : recon::intervals_of(survey).tracked) {
    if (interval.first > first || last > interval.last || first >= last) continue;
    return recon::SegmentRange{first, last, interval.limit};
  }
  return std::nullopt;
}

// One run: surveys the pulses, starts tasks until all segments are tracked, then joins them.
class ShardedTracking : public ShardedWork {
 public:
  ShardedTracking(const TrackRequest& request, const MakeTrackRunner& make_runner,
                  const std::function<void(int64_t)>& on_begin,
                  const std::function<void()>& on_pulse)
      : request_(request),
        on_pulse_(on_pulse),
        threads_(tracking_threads(request.threads)),
        input_(open_input(request)) {
    on_begin(std::ssize(input_->pulses()));
    with_threads(threads_, [&] { require_steps(request_, *input_); });
    folder_.emplace(TrackFolder::create(request));
    tasks_ = make_runner(*folder_);
  }

  TrackReport run() {
    ShardedRun run(*folder_, *tasks_, "track");
    folder_->remove_messages();
    plan();
    find_finished();
    if (!tracked_.empty()) {
      note(count_of(std::ssize(tracked_), "segment") + " kept from an earlier run");
    }
    run.make(*this);
    TrackReport report = join();
    folder_->remove();
    folder_->remove_others();
    return report;
  }

  void find_finished() override {
    for (bool is_new = true; is_new;) {
      is_new = false;
      for (const recon::SegmentRange& range : plan_.open) is_new |= find(range);
      if (is_new) plan_ = recon::plan_of(intervals_.tracked, tracked_);
    }
  }

  std::vector<take::FrameRange> missing() const override {
    std::vector<take::FrameRange> shards;
    for (const recon::SegmentRange& range : plan_.open) shards.push_back(shard_of(range));
    return shards;
  }

  void start(const std::vector<take::FrameRange>& shards, TaskRunner& tasks) override {
    // A damaged shard must not count as finished.
    for (const take::FrameRange& shard : shards) folder_->drop(*range_of(shard, survey_));
    tasks.start_each(shards);
  }

  bool watch() override {
    find_finished();
    return !plan_.open.empty();
  }

  std::vector<take::FrameRange> known_meanwhile() const override { return missing(); }

 private:
  /// The survey is saved, because each task needs that of the whole take.
  recon::TakeSurvey surveyed() {
    if (auto saved = folder_->find_survey()) return *std::move(saved);
    recon::TakeSurvey survey = with_threads(threads_, [&] {
      return recon::survey_pulses(source_of(*input_).surfaces, input_->pulses().size(),
                                  interruptible(on_pulse_));
    });
    if (recon::intervals_of(survey).tracked.empty()) reject_without_surface(request_);
    folder_->save_survey(survey);
    return survey;
  }

  void plan() {
    try {
      survey_ = surveyed();
    } catch (...) {
      folder_->remove();
      throw;
    }
    intervals_ = recon::intervals_of(survey_);
    plan_ = recon::plan_of(intervals_.tracked, tracked_);
  }

  /// True when the segment of the range is finished.
  bool find(const recon::SegmentRange& range) {
    const auto shard = folder_->find(range);
    if (!shard) return false;
    const recon::SegmentExtent extent = extent_of(shard->part.report, survey_.pulses);
    if (!is_within(extent, range)) return false;
    tracked_.emplace(range, extent);
    // A pulse has two turns after its survey, as in track_take().
    for (size_t turn = 0; turn < 2 * (extent.to - extent.from); ++turn) on_pulse_();
    return true;
  }

  TrackReport join() {
    MotionFile file(request_, survey_.pulses);
    std::vector<std::string> errors;
    for (const recon::SegmentRange& range : plan_.tracked) {
      const auto shard = folder_->find(range);
      if (!shard) throw std::runtime_error(folder_->path().string() + ": has changed");
      for (const std::string& error : shard->read_errors) {
        if (std::ranges::find(errors, error) == errors.end()) errors.push_back(error);
      }
      if (!file.add(shard->part, [&] { return track_again(range); })) break;
    }
    TrackReport report = file.finish(intervals_.untracked);
    report.is_unfinished = input_->is_unfinished();
    report.read_errors = std::move(errors);
    write_motion(request_, file.bytes());
    return report;
  }

  /// For a file that has no room for the whole segment.
  recon::TrackedSegment track_again(const recon::SegmentRange& range) {
    return with_threads(threads_, [&] {
      const recon::TakeSource take = source_of(*input_);
      const std::function<void()> ignored = [] {};
      const recon::OnPulse on_pulse = interruptible(ignored);
      return recon::RangeTracker(take, survey_, request_.tracking, on_pulse).track(range).segment;
    });
  }

  const TrackRequest& request_;
  const std::function<void()>& on_pulse_;
  const int threads_;  ///< of this process
  const std::unique_ptr<ObservedPulses> input_;
  std::optional<TrackFolder> folder_;
  std::unique_ptr<TaskRunner> tasks_;
  recon::TakeSurvey survey_;
  recon::TakeIntervals intervals_;
  recon::TrackedExtents tracked_;
  recon::SegmentPlan plan_;
};

TrackedShard make_shard(const TrackRequest& request, const recon::TakeSurvey& survey,
                        const recon::SegmentRange& range) {
  const std::unique_ptr<ObservedPulses> input = open_input(request);
  const recon::TakeSource take = source_of(*input);
  const std::function<void()> ignored = [] {};
  const recon::OnPulse on_pulse = interruptible(ignored);
  recon::RangeTracker tracker(take, survey, request.tracking, on_pulse);
  MotionPart part = encoded_part(tracker.track(range).segment, request.step_m);
  return {std::move(part), input->read_errors()};
}

}  // namespace

TrackReport track_sharded(const TrackRequest& request, const MakeTrackRunner& make_runner,
                          const std::function<void(int64_t pulses)>& on_begin,
                          const std::function<void()>& on_pulse) {
  const MonotonicInstant began = Monotonic::now();
  TrackReport report = ShardedTracking(request, make_runner, on_begin, on_pulse).run();
  report.peak_rss_mb = peak_rss_mb();
  report.seconds = to_seconds(Monotonic::now() - began);
  return report;
}

void track_shard(const TrackFolder& folder, take::FrameRange range, int threads) {
  try {
    const TrackRequest request = folder.request();
    const auto survey = folder.find_survey();
    const auto pulses = survey ? range_of(range, *survey) : std::nullopt;
    if (!pulses) throw InputError(folder.path().string() + ": has no such shard");
    if (folder.find(*pulses)) return;
    folder.save(*pulses,
                with_threads(threads, [&] { return make_shard(request, *survey, *pulses); }));
  } catch (const InputError& error) {
    folder.save_error(error.what());
    throw;
  }
}

}  // namespace v3d::ctl
