#include "daemon/pulse_recorder.h"

#include <algorithm>

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);
constexpr size_t kPulseQueue = 256;
/// A pulse number from the network so far ahead of all before is not believed.
constexpr int64_t kMaxJump = 15'000;

/// The same instant on the wall clock. The clocks are read together: their difference holds now.
RealtimeInstant to_realtime(MonotonicInstant t) { return Realtime::now() - (Monotonic::now() - t); }

}  // namespace

PulseRecorder::PulseRecorder(PulseSensor* sensor, Bus& bus, std::string take, Duration period,
                             const std::filesystem::path& log)
    : sensor_(sensor), bus_(bus), take_(std::move(take)), numbers_(period) {
  if (!log.empty()) log_.emplace(log);
  if (sensor_ != nullptr) {
    sensor_->reset();
  } else {
    heard_ = std::make_unique<Subscription<PulseMessage>>(bus_, kPulseChannel, kPulseQueue);
  }
  thread_ = std::thread([this] { run(); });
}

PulseRecorder::~PulseRecorder() {
  stopping_ = true;
  thread_.join();
}

void PulseRecorder::run() {
  while (!stopping_) {
    heartbeat_.beat();
    const auto pulse = next();
    if (!pulse) continue;
    if (log_ && !log_->write(*pulse)) ++write_errors_;
    if (sensor_ != nullptr) bus_.publish(kPulseChannel, encode(*pulse));
    seen_ = std::max<int64_t>(seen_, pulse->pulse + 1);
    ++sensed_;
  }
}

std::optional<PulseMessage> PulseRecorder::next() { return sensor_ != nullptr ? sense() : hear(); }

std::optional<PulseMessage> PulseRecorder::sense() {
  const auto edge = sensor_->wait(Monotonic::now() + kLook);
  if (!edge) return std::nullopt;
  return PulseMessage{.sent = Realtime::now(),
                      .seq = seq_++,
                      .take = take_,
                      .pulse = numbers_.number(edge->at),
                      .edge = to_realtime(edge->at),
                      .edge_monotonic = edge->at};
}

std::optional<PulseMessage> PulseRecorder::hear() {
  auto pulse = heard_->wait(Monotonic::now() + kLook);
  const bool ours =
      pulse && pulse->take == take_ && pulse->pulse >= seen_ && pulse->pulse - seen_ < kMaxJump;
  return ours ? std::move(pulse) : std::nullopt;
}

}  // namespace v3d
