#include "trigger/background_generator.h"

#include <utility>

#include "base/core/error.h"

namespace v3d {

BackgroundGenerator::BackgroundGenerator(std::unique_ptr<PulseGenerator> generator)
    : generator_(std::move(generator)), thread_([this] { run(); }) {}

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

int64_t BackgroundGenerator::ask(std::function<void()> work) {
  if (is_idle()) before_ = account();
  const std::lock_guard lock(mutex_);
  tasks_.push_back(std::move(work));
  changed_.notify_all();
  return ++asked_;
}

bool BackgroundGenerator::done_within(Duration patience, int64_t task) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, patience, [&] { return done_ >= task; });
}

void BackgroundGenerator::rethrow() {
  const std::lock_guard lock(mutex_);
  if (error_) std::rethrow_exception(error_);
}

BackgroundGenerator::Account BackgroundGenerator::account() const {
  if (!is_idle()) return before_;
  return {.commanded = generator_->commanded(),
          .first_pulse = generator_->first_pulse(),
          .finished = generator_->finished(),
          .counts_exactly = generator_->counts_exactly(),
          .statistics = generator_->statistics(),
          .fault = generator_->fault()};
}

void BackgroundGenerator::silence() {
  const int64_t task = ask([this] { generator_->silence(); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return done_ >= task; });
  lock.unlock();
  rethrow();
}

void BackgroundGenerator::arm(const PulseTrain& train) {
  stop();
  output_on_ = true;
  arming_ = ask([this, train] { generator_->arm(train); });
  before_ = {};
}

bool BackgroundGenerator::armed() {
  if (arming_ == 0) return output_on_;
  if (!done_within(Duration::zero(), arming_)) return false;
  arming_ = 0;
  rethrow();
  return true;
}

void BackgroundGenerator::start() {
  started_ = true;
  const int64_t task = ask([this] { generator_->start(); });
  if (!done_within(kPatience, task)) {
    throw InputError("the trigger does not start: the generator does not answer");
  }
  rethrow();
}

void BackgroundGenerator::stop() {
  if (!std::exchange(output_on_, false)) return;
  const bool started = std::exchange(started_, false);
  arming_ = 0;
  const int64_t task = ask([this] { generator_->stop(); });
  before_.finished = true;
  if (started) before_.fault = "pulses may go on: the generator has not answered yet";
  done_within(kPatience, task);
}

}  // namespace v3d
