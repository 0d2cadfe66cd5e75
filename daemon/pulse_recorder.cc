#include "daemon/pulse_recorder.h"

#include <algorithm>

#include "base/units.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);
constexpr size_t kPulseQueue = 256;
/// A pulse number from the network so far ahead of all before is not believed.
constexpr int64_t kMaxJump = 15'000;
/// A pulse that another host says is older, or still to come, was timed by a clock that is not
/// ours; then it was when it was heard of.
constexpr Duration kLongestOnTheWay = std::chrono::milliseconds(200);

/// The loss of a pulse is noticed by the next one, but of the last there is none: it is said again.
constexpr int kSaidAgain = 3;

/// The same instant on the wall clock. The clocks are read together: their difference holds now.
RealtimeInstant to_realtime(MonotonicInstant t) { return Realtime::now() - (Monotonic::now() - t); }

}  // namespace

PulseRecorder::PulseRecorder(PulseSensor* sensor, Bus& bus, Setup setup)
    : sensor_(sensor),
      bus_(bus),
      take_(std::move(setup.take)),
      on_edge_(std::move(setup.on_edge)),
      numbers_(setup.train) {
  if (!setup.log.empty()) {
    log_.emplace(setup.log, setup.past ? LogOpening::kGoOn : LogOpening::kNew);
  }
  if (setup.past) remember(*setup.past);
  if (sensor_ != nullptr) {
    sensor_->reset();
  } else {
    heard_ = std::make_unique<Subscription<PulseMessage>>(bus_, kPulseChannel, kPulseQueue);
  }
  thread_ = std::thread([this] { run(); });
}

void PulseRecorder::remember(const Past& past) {
  constexpr int64_t kOnTheirWay = 2;  // pulses that were commanded, and not heard of yet
  seen_ = std::max(past.sensed.last() + 1, past.commanded - kOnTheirWay);
  sensed_ = past.sensed;
}

PulseRecorder::~PulseRecorder() {
  stopping_ = true;
  thread_.join();
}

void PulseRecorder::run() {
  while (!stopping_) {
    heartbeat_.beat();
    const auto pulse = next();
    if (!pulse) {
      say_again();
      continue;
    }
    on_edge_(edge_of(*pulse));
    record(*pulse);
  }
  while (to_say_again_ > 0) say_again();
}

void PulseRecorder::say_again() {
  if (to_say_again_ == 0) return;
  --to_say_again_;
  bus_.publish(kPulseChannel, last_said_);
}

void PulseRecorder::record(const PulseMessage& pulse) {
  if (log_) log_->write(pulse);
  if (sensor_ != nullptr) {
    last_said_ = bus_.seal().closed(encode(pulse));
    bus_.publish(kPulseChannel, last_said_);
    to_say_again_ = kSaidAgain;
  }
  const std::lock_guard lock(mutex_);
  sensed_.insert(pulse.pulse);
  seen_ = std::max<int64_t>(seen_, pulse.pulse + 1);
}

PulseEdge PulseRecorder::edge_of(const PulseMessage& pulse) const {
  if (sensor_ != nullptr) return {.pulse = pulse.pulse, .at = pulse.edge_monotonic};
  const Duration ago = Realtime::now() - pulse.edge;
  const bool plausible = ago >= Duration::zero() && ago <= kLongestOnTheWay;
  return {.pulse = pulse.pulse,
          .at = Monotonic::now() - (plausible ? ago : Duration::zero()),
          .is_timed = plausible};
}

int64_t PulseRecorder::sensed() const {
  const std::lock_guard lock(mutex_);
  return sensed_.size();
}

void PulseRecorder::put_into(Ledger& ledger, int64_t commanded) const {
  const std::lock_guard lock(mutex_);
  ledger.sensed = sensed_.size();
  ledger.unsensed = sensed_.missing(commanded);
  ledger.extra = numbers_.extra();
  ledger.runt = numbers_.runts();
}

std::string PulseRecorder::trouble() const {
  const std::lock_guard lock(mutex_);
  const auto runts = static_cast<int64_t>(numbers_.runts().size());
  std::string text;
  if (numbers_.extra() > 0)
    text = format_count(numbers_.extra()) + " pulses more than the train has";
  if (runts > 0) text += (text.empty() ? "" : ", ") + format_count(runts) + " pulses too short";
  return text;
}

std::optional<PulseMessage> PulseRecorder::next() { return sensor_ != nullptr ? sense() : hear(); }

std::optional<PulseMessage> PulseRecorder::sense() {
  const auto edge = sensor_->wait(Monotonic::now() + kLook);
  if (!edge) return std::nullopt;
  const std::unique_lock lock(mutex_);
  const auto number = numbers_.number(*edge);
  if (!number) return std::nullopt;
  return PulseMessage{.sent = Realtime::now(),
                      .seq = seq_++,
                      .take = take_,
                      .pulse = *number,
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
