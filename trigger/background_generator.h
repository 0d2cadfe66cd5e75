// A generator that may keep its caller waiting, behind one that does not.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "trigger/pulse_generator.h"

namespace v3d {

/// Another generator, worked by a thread of its own. An instrument may take seconds to answer, and
/// a call of the kernel about one that hangs cannot be cut short: whoever has a watchdog to feed
/// must not make it. What is asked is done in its order; arm() returns at once, start() and stop()
/// after kPatience at the latest. After a stop() that took longer, fault() says that pulses may go
/// on until it is done. Only silence() waits for as long as it takes, and so does the destructor.
class BackgroundGenerator : public PulseGenerator {
 public:
  static constexpr Duration kPatience = std::chrono::seconds(2);

  explicit BackgroundGenerator(std::unique_ptr<PulseGenerator> generator);
  ~BackgroundGenerator() override;
  BackgroundGenerator(const BackgroundGenerator&) = delete;
  BackgroundGenerator& operator=(const BackgroundGenerator&) = delete;

  void silence() override;
  void arm(const PulseTrain& train) override;
  bool armed() override;
  void start() override;
  void stop() override;
  int64_t commanded() const override { return account().commanded; }
  std::optional<MonotonicInstant> first_pulse() const override { return account().first_pulse; }
  bool finished() const override { return account().finished; }
  bool counts_exactly() const override { return account().counts_exactly; }
  PulseStatistics statistics() const override { return account().statistics; }
  std::string fault() const override { return account().fault; }

 private:
  /// What a generator says of itself.
  struct Account {
    int64_t commanded = 0;
    std::optional<MonotonicInstant> first_pulse;
    bool finished = true;
    bool counts_exactly = true;
    PulseStatistics statistics;
    std::string fault;
  };
  /// Of the generator, or as it was before what it is at work on.
  Account account() const;
  bool is_idle() const;
  /// Returns the number of the task, from 1 on.
  int64_t ask(std::function<void()> work);
  bool done_within(Duration patience, int64_t task);
  /// Of the last task that was done.
  void rethrow();
  void run();

  const std::unique_ptr<PulseGenerator> generator_;  ///< the thread's own while it is at work
  Account before_;                                   ///< of what it is at work on
  int64_t arming_ = 0;      ///< the task, until armed() has told how it went; else 0
  bool output_on_ = false;  ///< it was asked to arm, and not yet to stop
  bool started_ = false;    ///< since it was asked to arm

  mutable std::mutex mutex_;  ///< what follows
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;  ///< the first one is being done
  int64_t asked_ = 0;
  int64_t done_ = 0;
  std::exception_ptr error_;  ///< of the last one that was done
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace v3d
