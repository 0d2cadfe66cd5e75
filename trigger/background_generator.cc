#include "trigger/background_generator.h"

#include <utility>

#include "base/core/error.h"

namespace v3d::trigger {

BackgroundGenerator::BackgroundGenerator(std::unique_ptr<PulseGenerator> generator,
                                         Duration max_wait)
    : generator_(std::move(generator)), max_wait_(max_wait), thread_([this] { run(); }) {}

BackgroundGenerator::~BackgroundGenerator() {
  stop();
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void BackgroundGenerator::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return quit_ || !tasks_.empty(); });
    if (tasks_.empty()) return;
    const std::function<void()>& work = tasks_.front();
    lock.unlock();
    std::exception_ptr error;
    try {
      work();
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    tasks_.pop_front();
    error_ = error;
    ++done_;
    changed_.notify_all();
  }
}

bool BackgroundGenerator::is_idle() const {
  const std::lock_guard lock(mutex_);
  return tasks_.empty();
}

int64_t BackgroundGenerator::enqueue(std::function<void()> work) {
  if (is_idle()) last_status_ = status();
  const std::lock_guard lock(mutex_);
  tasks_.push_back(std::move(work));
  changed_.notify_all();
  return ++enqueued_;
}

bool BackgroundGenerator::wait_until_done(Duration timeout, int64_t task) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [&] { return done_ >= task; });
}

void BackgroundGenerator::rethrow_last_error() {
  const std::lock_guard lock(mutex_);
  if (error_) std::rethrow_exception(error_);
}

BackgroundGenerator::Status BackgroundGenerator::status() const {
  if (!is_idle()) return last_status_;
  return {.commanded = generator_->commanded(),
          .first_pulse = generator_->first_pulse(),
          .finished = generator_->finished(),
          .counts_exactly = generator_->counts_exactly(),
          .statistics = generator_->statistics(),
          .fault = generator_->fault()};
}

void BackgroundGenerator::silence() {
  const int64_t task = enqueue([this] { generator_->silence(); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return done_ >= task; });
  lock.unlock();
  rethrow_last_error();
}

void BackgroundGenerator::arm(const PulseTrain& train) {
  stop();
  output_on_ = true;
  arming_task_ = enqueue([this, train] { generator_->arm(train); });
  std::string fault = std::move(last_status_.fault);  // pulses may continue until it is armed
  last_status_ = {};
  last_status_.fault = std::move(fault);
}

bool BackgroundGenerator::armed() {
  if (arming_task_ == 0) return output_on_;
  if (!wait_until_done(Duration::zero(), arming_task_)) return false;
  arming_task_ = 0;
  rethrow_last_error();
  return true;
}

void BackgroundGenerator::start() {
  started_ = true;
  const int64_t task = enqueue([this] { generator_->start(); });
  if (!wait_until_done(max_wait_, task)) {
    throw InputError("the trigger does not start: no answer from the generator within " +
                     std::to_string(max_wait_ / std::chrono::seconds(1)) + " s");
  }
  rethrow_last_error();
}

void BackgroundGenerator::stop() {
  if (!std::exchange(output_on_, false)) return;
  const bool started = std::exchange(started_, false);
  arming_task_ = 0;
  const int64_t task = enqueue([this] { generator_->stop(); });
  last_status_.finished = true;
  if (started) {
    last_status_.fault = std::string(kPulsesMayContinue) + ": the generator has not answered yet";
  }
  wait_until_done(max_wait_, task);
}

void BackgroundGenerator::retry_stop() {
  if (output_on_ || !is_idle() || generator_->fault().empty()) return;
  enqueue([this] { generator_->stop(); });
}

}  // namespace v3d::trigger
