#include "trigger/gpio_generator.h"

#include <algorithm>
#include <utility>

#include "base/core/check.h"
#include "base/core/error.h"
#include "base/core/memory.h"

namespace v3d {
namespace {

/// A pulse that is later than period / kSkipDivisor is skipped.
constexpr int kSkipDivisor = 4;

}  // namespace

GpioGenerator::GpioGenerator(StudioLine line, OpenOutputLine open, HostClock clock)
    : line_(std::move(line)), open_(std::move(open)), train_(*this, std::move(clock)) {}

GpioGenerator::~GpioGenerator() = default;

void GpioGenerator::request_line(const PacedTrain::Plan& plan) {
  train_.plan(plan);
  if (output_ && output_->set(false)) return;
  output_.reset();
  output_ = open_(line_);
}

void GpioGenerator::silence() { request_line({}); }

void GpioGenerator::arm(const PulseTrain& train) {
  check_train(train, "GPIO trigger");
  const Duration period = period_of(train.rate_hz);
  if (train.width > period / 2) {
    throw InputError("GPIO trigger: a pulse of " +
                     std::to_string(train.width / std::chrono::microseconds(1)) +
                     " us is more than half a period; right would be at most " +
                     std::to_string(period / 2 / std::chrono::microseconds(1)) + " us");
  }
  lock_memory();
  request_line({.period = period,
                .width = train.width,
                .count = train.count,
                .skip_after = period / kSkipDivisor});
}

void GpioGenerator::start() {
  V3D_CHECK(output_ && "arm() comes first");
  train_.start();
}

std::string GpioGenerator::fault() const {
  return train_.output_failed() ? "GPIO line " + line_text(line_) + " is gone" : train_.fault();
}

}  // namespace v3d
