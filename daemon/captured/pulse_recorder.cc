#include "daemon/captured/pulse_recorder.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "base/core/text.h"
#include "base/io/file.h"
#include "daemon/captured/timecode_output.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(50);
constexpr size_t kQueuePulses = 4096;

}  // namespace

PulseLog::PulseLog(const std::filesystem::path& path, take::LogOpening opening,
                   Duration sync_period)
    : log_(path, opening, take::LogHashing::kChecksum, sync_period), queue_(kQueuePulses) {
  if (auto synced = io::sync_folder(path.parent_path()); !synced) {
    io::throw_input_error(synced.error());
  }
  thread_ = std::thread([this] { run(); });
}

PulseLog::~PulseLog() { close(); }

void PulseLog::close() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  thread_.join();
  synced_ = log_.sync();
  if (!synced_) spdlog::error("{}", synced_.error().message);
}

void PulseLog::write(const wire::PulseMessage& pulse, std::optional<RealtimeInstant> edge_here) {
  queue_.push({pulse, edge_here});
}

void PulseLog::run() {
  for (;;) {
    const bool is_last_iteration = stopping_;
    const auto next =
        queue_.pop(is_last_iteration ? Monotonic::now() : Monotonic::now() + kPollInterval);
    if (next) {
      const io::Status written = log_.write(next->pulse, next->edge_here);
      if (!written && ++failed_ == 1) spdlog::error("{}", written.error().message);
    }
    if (!next && is_last_iteration) return;
  }
}

namespace {

/// Commanded pulses whose messages have not arrived yet.
constexpr int64_t kMaxInFlight = 2;

}  // namespace

KnownPulses::KnownPulses(std::string take, MonotonicInstant now)
    : KnownPulses(std::move(take), {}, 0, now) {}

KnownPulses::KnownPulses(std::string take, take::PulseSet sensed, int64_t commanded,
                         MonotonicInstant now)
    : take_(std::move(take)),
      sensed_(std::move(sensed)),
      seen_(std::max(sensed_.last() + 1, commanded - kMaxInFlight)) {
  plausible_.add(seen_, now);
}

bool KnownPulses::accepts(const wire::PulseMessage& pulse, MonotonicInstant now) const {
  return pulse.take == take_ && pulse.pulse >= seen_ && plausible_.contains(pulse.pulse, now);
}

void KnownPulses::add(int64_t pulse, MonotonicInstant now) {
  sensed_.insert(pulse);
  plausible_.add(pulse, now);
  seen_ = std::max(seen_, pulse + 1);
}

void KnownPulses::fill_ledger(take::Ledger& ledger, int64_t commanded) const {
  ledger.sensed = sensed_.size();
  ledger.unsensed = sensed_.missing(commanded);
}

bool sensed_count_is_known(bool has_sense_line, bool senses_here, int64_t sensed,
                           int64_t commanded) {
  return has_sense_line && (senses_here || sensed >= commanded);
}

bool is_empty_take(const take::Ledger& ledger, bool was_started, bool trigger_is_here) {
  if (was_started && !trigger_is_here) return false;
  const bool no_pulse = ledger.commanded == 0 && ledger.sensed.value_or(0) == 0;
  return no_pulse &&
         std::all_of(ledger.cameras.begin(), ledger.cameras.end(),
                     [](const take::CameraLedger& camera) { return camera.written == 0; });
}

namespace {

constexpr size_t kPulseQueue = 256;
/// Without authentication: a pulse that is older than this, or in the future, was timed by a clock
/// that differs from that of this PC.
constexpr Duration kMaxNetworkDelay = std::chrono::milliseconds(200);
/// Clocks that differ by less are synchronised. The least delay of a message is mostly shorter. An
/// error of the time of a pulse must be much shorter than the latency of the fastest camera:
/// otherwise the frame of the next pulse seems to be of this one (capture::find_start()).
constexpr Duration kSynchronised = std::chrono::milliseconds(2);
/// The session of an older message was challenged, and its response has not arrived yet.
constexpr Duration kMaxPulseAge = bus::SessionReplayFilter::kSeemsOld;

/// A lost message is noticed when the next one arrives. The last pulse has no next one, so its
/// message is sent again.
constexpr int kResends = 3;

KnownPulses known_pulses(const std::string& take,
                         const std::optional<PulseRecorder::Resume>& resume) {
  const MonotonicInstant now = Monotonic::now();
  return resume ? KnownPulses(take, resume->sensed, resume->commanded, now)
                : KnownPulses(take, now);
}

/// Whether two times lie within ten seconds. For any values: their difference may overflow.
bool are_close(RealtimeInstant a, RealtimeInstant b) {
  return std::abs(static_cast<double>(to_ns(a)) - static_cast<double>(to_ns(b))) < 10e9;
}

std::optional<LocalPulse> open_pulse(const bus::ReceivedMessage& in) {
  if (!in.is_accepted) return std::nullopt;
  auto pulse = wire::decode<wire::PulseMessage>(in.bytes);
  if (!pulse) return std::nullopt;
  const capture::PulseEdge local_edge = edge_on_this_pc(*pulse, in, bus::ReceiverTime::now());
  return LocalPulse{*std::move(pulse), local_edge};
}

}  // namespace

capture::PulseEdge edge_on_this_pc(const wire::PulseMessage& pulse, const bus::ReceivedMessage& in,
                                   const bus::ReceiverTime& now) {
  const auto edge = [&](MonotonicInstant at) {
    return capture::PulseEdge{.pulse = pulse.pulse, .at = at};
  };
  const capture::PulseEdge unknown{.pulse = pulse.pulse, .at = now.monotonic, .is_timed = false};
  std::optional<Duration> ago;  // by the wall clocks
  if (are_close(now.realtime, pulse.edge)) ago = now.realtime - pulse.edge;
  if (!in.sent || !in.sent_here) {
    const bool is_plausible = ago && *ago >= Duration::zero() && *ago <= kMaxNetworkDelay;
    return is_plausible ? edge(now.monotonic - *ago) : unknown;
  }
  if (!are_close(*in.sent, pulse.edge)) return unknown;
  const MonotonicInstant compared = *in.sent_here - (*in.sent - pulse.edge);
  const bool agrees = ago && std::chrono::abs(now.monotonic - *ago - compared) <= kSynchronised;
  if (agrees) return edge(now.monotonic - *ago);
  return in.age <= kMaxPulseAge ? edge(compared) : unknown;
}

PulseRecorder::PulseRecorder(trigger::PulseSensor* sensor, bus::Bus& bus, Setup setup)
    : sensor_(sensor),
      bus_(bus),
      take_(std::move(setup.take)),
      on_edge_(std::move(setup.on_edge)),
      numbers_(setup.train),
      known_(known_pulses(take_, setup.resume)) {
  if (!setup.log.empty()) {
    log_.emplace(setup.log, setup.resume ? take::LogOpening::kContinue : take::LogOpening::kNew);
  }
  if (sensor_ != nullptr) {
    sensor_->reset();
  } else {
    subscription_ = std::make_unique<bus::Subscription<LocalPulse>>(bus_, wire::kPulseChannel,
                                                                    kPulseQueue, open_pulse);
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
      resend_last();
      continue;
    }
    on_edge_(pulse->local_edge);
    record(*pulse);
  }
  while (resends_left_ > 0) resend_last();
}

void PulseRecorder::resend_last() {
  if (resends_left_ == 0) return;
  --resends_left_;
  bus_.publish_authenticated(wire::kPulseChannel, last_message_);
}

void PulseRecorder::record(const LocalPulse& pulse) {
  std::optional<RealtimeInstant> edge_here;
  if (pulse.local_edge.is_timed) edge_here = to_realtime(pulse.local_edge.at);
  if (log_) log_->write(pulse, edge_here);
  if (sensor_ != nullptr) {
    last_message_ = encode(pulse);
    bus_.publish_authenticated(wire::kPulseChannel, last_message_);
    resends_left_ = kResends;
  }
  const std::lock_guard lock(mutex_);
  known_.add(pulse.pulse, Monotonic::now());
}

void PulseRecorder::start(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  started_ = now;
}

int64_t PulseRecorder::sensed() const {
  const std::lock_guard lock(mutex_);
  return known_.count();
}

int64_t PulseRecorder::seen() const {
  const std::lock_guard lock(mutex_);
  return known_.seen();
}

void PulseRecorder::fill_ledger(take::Ledger& ledger, int64_t commanded) const {
  const std::lock_guard lock(mutex_);
  known_.fill_ledger(ledger, commanded);
  ledger.extra = numbers_.extra();
  ledger.runt = numbers_.runts();
}

std::string PulseRecorder::warning() const {
  const std::lock_guard lock(mutex_);
  const auto runts = static_cast<int64_t>(numbers_.runts().size());
  std::string text;
  if (numbers_.extra() > 0) text = format_count(numbers_.extra()) + " extra pulses";
  if (runts > 0)
    text += (text.empty() ? "" : ", ") + format_count(runts) + " runt pulses (too short)";
  return text;
}

std::optional<LocalPulse> PulseRecorder::next() { return sensor_ != nullptr ? sense() : receive(); }

std::optional<LocalPulse> PulseRecorder::sense() {
  const auto edge = sensor_->wait(Monotonic::now() + kPollInterval);
  if (!edge) return std::nullopt;
  const std::unique_lock lock(mutex_);
  if (!started_ || edge->at < *started_) {
    numbers_.count_extra();
    return std::nullopt;
  }
  const auto number = numbers_.number(*edge);
  if (!number) return std::nullopt;
  return LocalPulse{{.sent = Realtime::now(),
                     .seq = seq_++,
                     .take = take_,
                     .pulse = *number,
                     .edge = to_realtime(edge->at),
                     .edge_monotonic = edge->at},
                    {.pulse = *number, .at = edge->at}};
}

std::optional<LocalPulse> PulseRecorder::receive() {
  auto pulse = subscription_->wait(Monotonic::now() + kPollInterval);
  const std::lock_guard lock(mutex_);
  return pulse && known_.accepts(*pulse, Monotonic::now()) ? std::move(pulse) : std::nullopt;
}

}  // namespace v3d::captured
