#include "daemon/captured/pulse_recorder.h"

#include "base/units.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);
constexpr size_t kPulseQueue = 256;
/// A pulse that another host says is older, or still to come, was timed by a clock that is not
/// ours; then it was when it was heard of.
constexpr Duration kLongestOnTheWay = std::chrono::milliseconds(200);

/// The loss of a pulse is noticed by the next one, but of the last there is none: it is said again.
constexpr int kSaidAgain = 3;

/// The same instant on the wall clock. The clocks are read together: their difference holds now.
RealtimeInstant to_realtime(MonotonicInstant t) { return Realtime::now() - (Monotonic::now() - t); }

KnownPulses known_pulses(const std::string& take, const std::optional<PulseRecorder::Past>& past) {
  return past ? KnownPulses(take, past->sensed, past->commanded) : KnownPulses(take);
}

}  // namespace

PulseRecorder::PulseRecorder(PulseSensor* sensor, Bus& bus, Setup setup)
    : sensor_(sensor),
      bus_(bus),
      take_(std::move(setup.take)),
      on_edge_(std::move(setup.on_edge)),
      numbers_(setup.train),
      known_(known_pulses(take_, setup.past)) {
  if (!setup.log.empty()) {
    log_.emplace(setup.log, setup.past ? LogOpening::kGoOn : LogOpening::kNew);
  }
  if (sensor_ != nullptr) {
    sensor_->reset();
  } else {
    heard_ = std::make_unique<Subscription<PulseMessage>>(bus_, kPulseChannel, kPulseQueue);
  }
  thread_ = std::thread([this] { run(); });
}

PulseRecorder::~PulseRecorder() { close(); }

void PulseRecorder::close() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  if (log_) log_->close();
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
  bus_.publish_sealed(kPulseChannel, last_said_);
}

void PulseRecorder::record(const PulseMessage& pulse) {
  if (log_) log_->write(pulse);
  if (sensor_ != nullptr) {
    last_said_ = encode(pulse);
    bus_.publish_sealed(kPulseChannel, last_said_);
    to_say_again_ = kSaidAgain;
  }
  const std::lock_guard lock(mutex_);
  known_.add(pulse.pulse);
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
  return known_.count();
}

int64_t PulseRecorder::seen() const {
  const std::lock_guard lock(mutex_);
  return known_.seen();
}

void PulseRecorder::put_into(Ledger& ledger, int64_t commanded) const {
  const std::lock_guard lock(mutex_);
  known_.put_into(ledger, commanded);
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
  const std::lock_guard lock(mutex_);
  return pulse && known_.accepts(*pulse) ? std::move(pulse) : std::nullopt;
}

}  // namespace v3d
