#include "daemon/pulse_log.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);
constexpr size_t kQueuePulses = 4096;

}  // namespace

PulseLog::PulseLog(const std::filesystem::path& path, LogOpening opening)
    : log_(path, opening), queue_(kQueuePulses) {
  thread_ = std::thread([this] { run(); });
}

PulseLog::~PulseLog() {
  stopping_ = true;
  thread_.join();
}

void PulseLog::write(const PulseMessage& pulse) { queue_.push(pulse); }

void PulseLog::run() {
  for (;;) {
    const bool last_look = stopping_;
    const auto pulse = queue_.pop(last_look ? Monotonic::now() : Monotonic::now() + kLook);
    if (pulse && !log_.write(*pulse)) ++refused_;
    if (!pulse && last_look) return;
  }
}

}  // namespace v3d
