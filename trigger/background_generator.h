// Asynchronous adapter of a pulse generator: runs a slow generator on a thread of its own.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "trigger/pulse_generator.h"

namespace v3d::trigger {

/// Calls another generator on a thread of its own.
///
/// An instrument may take seconds to answer, and a system call on an instrument that hangs cannot
/// be interrupted. A thread that feeds a watchdog must not make such a call. Tasks run in the order
/// of the calls. arm() returns at once; start() and stop() return after at most `max_wait`. After a
/// stop() that takes longer, fault() reports that pulses may continue until the task ends. Only
/// silence() and the destructor wait without a limit.
class BackgroundGenerator : public PulseGenerator {
 public:
  explicit BackgroundGenerator(std::unique_ptr<PulseGenerator> generator,
                               Duration max_wait = std::chrono::seconds(2));
  ~BackgroundGenerator() override;
  BackgroundGenerator(const BackgroundGenerator&) = delete;
  BackgroundGenerator& operator=(const BackgroundGenerator&) = delete;

  void silence() override;
  void arm(const PulseTrain& train) override;
  bool armed() override;
  void start() override;
  void stop() override;
  void retry_stop() override;
  int64_t commanded() const override { return status().commanded; }
  std::optional<MonotonicInstant> first_pulse() const override { return status().first_pulse; }
  bool finished() const override { return status().finished; }
  bool counts_exactly() const override { return status().counts_exactly; }
  PulseStatistics statistics() const override { return status().statistics; }
  std::string fault() const override { return status().fault; }

 private:
  /// Results of the query functions of a generator.
  struct Status {
    int64_t commanded = 0;
    std::optional<MonotonicInstant> first_pulse;
    bool finished = true;
    bool counts_exactly = true;
    PulseStatistics statistics;
    std::string fault;
  };
  /// The status of the generator, or last_status_ while tasks run.
  Status status() const;
  bool is_idle() const;
  /// Adds a task. Returns its number; the first task has number 1.
  int64_t enqueue(std::function<void()> work);
  /// Returns false where the task is not done within `timeout`.
  bool wait_until_done(Duration timeout, int64_t task);
  /// Throws the error of the last finished task, if any.
  void rethrow_last_error();
  void run();

  const std::unique_ptr<PulseGenerator> generator_;  ///< used by the thread only, while tasks run
  const Duration max_wait_;
  Status last_status_;       ///< status before the pending tasks, as changed by arm() and stop()
  int64_t arming_task_ = 0;  ///< number of the task, until armed() has reported its result; else 0
  bool output_on_ = false;   ///< between arm() and stop()
  bool started_ = false;     ///< start() was called since arm()

  mutable std::mutex mutex_;  ///< guards the next members
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;  ///< the first one runs
  int64_t enqueued_ = 0;
  int64_t done_ = 0;
  std::exception_ptr error_;  ///< of the last finished task; null: none
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace v3d::trigger
