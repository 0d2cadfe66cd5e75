// Frame pipeline: runs the stages of several frames at the same time, one frame per stage.
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

namespace v3d::recon {

/// While a serial part of one stage leaves threads idle, these threads work on the other frames in
/// flight. Each stage holds one frame at a time, and frames pass in order, so there are at most as
/// many frames in flight as stages. When two stages could start and one thread is free, the older
/// frame has priority; idle threads help in the parallel loops of running stages.
///
/// All stages share one TBB arena of `threads` workers. (In a tbb::parallel_pipeline, a source that
/// waits for a live frame would occupy a worker.)
template <class Job>
class FramePipeline {
 public:
  /// Returns the next frame; empty at the end. Called by a separate thread, only when the first
  /// stage is free. The caller decides what happens to frames that wait meanwhile.
  using Source = std::function<std::optional<Job>()>;
  using Stage = std::function<void(Job&)>;

  /// `threads` 0: one per core. Starts at once. Objects that `source` and `stages` refer to must
  /// outlive the pipeline.
  FramePipeline(int threads, Source source, std::vector<Stage> stages)
      : threads_(threads > 0 ? threads : tbb::info::default_concurrency()),
        source_(std::move(source)),
        stages_(std::move(stages)),
        slots_(stages_.size()),
        allowed_(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads_) + 1),
        arena_(threads_, 0),
        feeder_([this] { feed(); }) {}

  /// Waits for the end of the source and for the frames in flight.
  ~FramePipeline() { join(); }
  FramePipeline(const FramePipeline&) = delete;
  FramePipeline& operator=(const FramePipeline&) = delete;

  /// Waits until the source has ended and every frame has passed. The first exception of the source
  /// or of a stage ends the pipeline and is rethrown here; later frames are dropped.
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
    std::optional<Job> finished;  // destroyed after the lock is released
    const std::lock_guard lock(mutex_);
    --running_;
    slots_[stage].state = State::kDone;
    if (error) fail(error);
    finished = advance();
    begin();
    changed_.notify_all();
  }

  // The functions below require a locked mutex_.

  /// Starts waiting stages, later ones first: these hold older frames.
  void begin() {
    for (size_t stage = slots_.size(); stage-- > 0 && running_ < threads_;) {
      Slot& slot = slots_[stage];
      if (!slot.job || slot.state != State::kWaiting) continue;
      slot.state = State::kRunning;
      ++running_;
      arena_.enqueue([this, stage] { run(stage); });
    }
  }

  /// Moves finished frames into free stages; returns the one that has passed the last stage.
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
  std::mutex mutex_;  ///< guards the members below; a running stage owns its job
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  int running_ = 0;
  std::exception_ptr error_;
  const tbb::global_control allowed_;
  tbb::task_arena arena_;
  std::thread feeder_;
};

}  // namespace v3d::recon
