// Frames in flight: the stages of a chain work on consecutive frames at the same time.
#pragma once

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace v3d {

/// A serial part of one stage would leave the other threads without work; here they do the next
/// stage of the frame before, or begin the frame after. Every stage holds one frame at a time, and
/// frames pass it in order; so there are never more frames in flight than stages. Where two stages
/// could begin and there is one thread, the older frame goes first; what no stage run needs helps
/// in the loops of those that run.
///
/// The stages work in one TBB arena of `threads` workers, so there are never more. (It is not a
/// tbb::parallel_pipeline, because there a source that waits for a live frame holds a worker.)
template <class Job>
class FramePipeline {
 public:
  /// The next frame; empty when there is none any more. Called by a thread of its own, and only
  /// when the first stage is free: what waits meanwhile is the caller's to keep or to drop.
  using Source = std::function<std::optional<Job>()>;
  using Stage = std::function<void(Job&)>;

  /// `threads` 0: one per core. Begins at once. What `source` and `stages` refer to outlives the
  /// pipeline.
  FramePipeline(int threads, Source source, std::vector<Stage> stages)
      : threads_(threads > 0 ? threads : tbb::info::default_concurrency()),
        source_(std::move(source)),
        stages_(std::move(stages)),
        slots_(stages_.size()),
        allowed_(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads_) + 1),
        arena_(threads_, 0),
        feeder_([this] { feed(); }) {}

  /// Waits for the source to end and for the frames in flight.
  ~FramePipeline() { join(); }
  FramePipeline(const FramePipeline&) = delete;
  FramePipeline& operator=(const FramePipeline&) = delete;

  /// Returns when the source has ended and every frame is through. The first exception of the
  /// source or of a stage ends the pipeline, and is thrown here: later frames are thrown away.
  void wait() {
    join();
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  enum class State : uint8_t { kWaiting, kRunning, kDone };
  /// One stage, and the frame that it holds.
  struct Slot {
    std::optional<Job> job;
    State state = State::kWaiting;
  };

  void join() {
    if (feeder_.joinable()) feeder_.join();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] {
      return std::none_of(slots_.begin(), slots_.end(),
                          [](const Slot& s) { return s.job.has_value(); });
    });
  }

  void feed() {
    try {
      while (wait_for_room()) {
        auto job = source_();
        if (!job) return;
        const std::lock_guard lock(mutex_);
        if (error_) return;
        slots_[0] = {std::move(job), State::kWaiting};
        begin();
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      fail(std::current_exception());
    }
  }

  /// False when the pipeline has failed.
  bool wait_for_room() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return error_ || (!slots_[0].job && running_ < threads_); });
    return !error_;
  }

  void run(size_t stage) {
    std::exception_ptr error;
    try {
      stages_[stage](*slots_[stage].job);
    } catch (...) {
      error = std::current_exception();
    }
    std::optional<Job> finished;  // goes after the lock
    const std::lock_guard lock(mutex_);
    --running_;
    slots_[stage].state = State::kDone;
    if (error) fail(error);
    finished = advance();
    begin();
    changed_.notify_all();
  }

  // --- with mutex_ held
  // ---------------------------------------------------------------------------

  /// Later stages hold older frames: they go first.
  void begin() {
    for (size_t stage = slots_.size(); stage-- > 0 && running_ < threads_;) {
      Slot& slot = slots_[stage];
      if (!slot.job || slot.state != State::kWaiting) continue;
      slot.state = State::kRunning;
      ++running_;
      arena_.enqueue([this, stage] { run(stage); });
    }
  }

  /// Moves frames on into stages that have become free; gives the one that is through.
  std::optional<Job> advance() {
    std::optional<Job> finished;
    for (size_t stage = slots_.size(); stage-- > 0;) {
      Slot& slot = slots_[stage];
      if (!slot.job || slot.state != State::kDone) continue;
      if (error_ || stage + 1 == slots_.size()) {
        finished = std::exchange(slot.job, std::nullopt);
      } else if (!slots_[stage + 1].job) {
        slots_[stage + 1] = {std::exchange(slot.job, std::nullopt), State::kWaiting};
      }
    }
    return finished;
  }

  void fail(std::exception_ptr error) {
    if (!error_) error_ = std::move(error);
    for (Slot& slot : slots_) {
      if (slot.state != State::kRunning) slot.job.reset();
    }
    changed_.notify_all();
  }

  const int threads_;
  const Source source_;
  const std::vector<Stage> stages_;
  std::mutex mutex_;  ///< what follows; the job of a running stage is that stage's alone
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  int running_ = 0;
  std::exception_ptr error_;
  const tbb::global_control allowed_;
  tbb::task_arena arena_;
  std::thread feeder_;
};

}  // namespace v3d
