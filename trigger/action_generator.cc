#include "trigger/action_generator.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <utility>

#include "base/core/error.h"
#include "base/io/action_packet.h"
#include "base/io/process.h"

namespace v3d::trigger {
namespace {

/// Queue length: where no one reads the sensed pulses, the oldest are discarded.
constexpr size_t kMaxPulses = 65'536;

uint32_t ipv4_of(const ActionCamera& camera) {
  in_addr address{};
  if (inet_pton(AF_INET, camera.address.c_str(), &address) == 1) return ntohl(address.s_addr);
  throw InputError("action trigger: camera " + camera.name + ": '" + camera.address +
                   "' is not an IPv4 address");
}

void add(std::string& list, const std::string& name) { list += (list.empty() ? "" : ", ") + name; }

}  // namespace

ActionAcknowledgements::ActionAcknowledgements(std::vector<ActionCamera> cameras) {
  for (ActionCamera& camera : cameras) {
    cameras_.push_back({.name = camera.name, .address = ipv4_of(camera)});
  }
}

void ActionAcknowledgements::reset() {
  const std::lock_guard lock(mutex_);
  for (Camera& camera : cameras_) {
    camera = {.name = std::move(camera.name), .address = camera.address};
  }
  commands_.clear();
  ready_.clear();
  counts_ = {};
}

void ActionAcknowledgements::sent(int64_t number, uint16_t request, MonotonicInstant at) {
  {
    const std::lock_guard lock(mutex_);
    commands_.push_back({.number = number,
                         .request = request,
                         .at = at,
                         .answered = std::vector<bool>(cameras_.size())});
  }
  changed_.notify_all();
}

void ActionAcknowledgements::received(uint32_t address,
                                      const io::ActionAcknowledgement& acknowledgement,
                                      MonotonicInstant now) {
  {
    const std::lock_guard lock(mutex_);
    advance(now);
    const auto camera = std::ranges::find(cameras_, address, &Camera::address);
    const auto command = std::ranges::find(commands_, acknowledgement.request, &Command::request);
    if (camera == cameras_.end()) {
      ++counts_.foreign;
      return;
    }
    if (command == commands_.end()) {
      ++counts_.late;
      return;
    }
    const auto index = static_cast<size_t>(camera - cameras_.begin());
    if (command->answered[index]) {
      ++counts_.repeated;
      return;
    }
    command->answered[index] = true;
    if (acknowledgement.status == io::ActionStatus::kSuccess) {
      ++counts_.acknowledged;
      command->sensed = true;
    } else {
      ++counts_.rejected;
      ++camera->rejected;
      camera->last_rejection = acknowledgement.status;
    }
  }
  changed_.notify_all();
}

void ActionAcknowledgements::expire(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  advance(now);
}

void ActionAcknowledgements::advance(MonotonicInstant now) {
  for (Command& command : commands_) {
    if (command.is_reported) continue;
    const bool is_over = now >= command.at + kDeadline;
    if (now < command.at || (!command.sensed && !is_over)) break;
    command.is_reported = true;
    if (!command.sensed) continue;
    if (ready_.size() >= kMaxPulses) ready_.pop_front();
    ready_.push_back({.number = command.number, .at = command.at, .is_numbered = true});
  }
  while (!commands_.empty() && now >= commands_.front().at + kDeadline) {
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (commands_.front().answered[i]) continue;
      ++cameras_[i].missing;
      ++counts_.missing;
    }
    commands_.pop_front();
  }
}

MonotonicInstant ActionAcknowledgements::next_change(MonotonicInstant deadline) const {
  const auto first = std::ranges::find(commands_, false, &Command::is_reported);
  if (first == commands_.end()) return deadline;
  return std::min(deadline, first->sensed ? first->at : first->at + kDeadline);
}

std::optional<SensedPulse> ActionAcknowledgements::wait(MonotonicInstant deadline) {
  std::unique_lock lock(mutex_);
  for (;;) {
    const MonotonicInstant now = Monotonic::now();
    advance(now);
    if (!ready_.empty()) {
      const SensedPulse pulse = ready_.front();
      ready_.pop_front();
      return pulse;
    }
    if (now >= deadline) return std::nullopt;
    changed_.wait_for(lock, next_change(deadline) - now);
  }
}

AcknowledgementCounts ActionAcknowledgements::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string ActionAcknowledgements::warning() const {
  const std::lock_guard lock(mutex_);
  std::string missing;
  std::string rejected;
  for (const Camera& camera : cameras_) {
    if (camera.missing > 0) add(missing, camera.name);
    if (camera.rejected > 0) {
      add(rejected, camera.name + " (" + io::text_of(camera.last_rejection) + ")");
    }
  }
  std::string text;
  if (!missing.empty()) {
    text = std::to_string(counts_.missing) +
           " acknowledgements of action commands missing: " + missing;
  }
  if (!rejected.empty()) {
    text += (text.empty() ? "" : "; ") + std::to_string(counts_.rejected) +
            " action commands rejected: " + rejected;
  }
  return text;
}

namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(20);
/// A larger change of the difference of the clocks means that the clock was set.
constexpr Duration kMaxSlew = std::chrono::milliseconds(1);
/// Without a time, a command that is later than period / kSkipDivisor is skipped.
constexpr int kSkipDivisor = 4;
constexpr int kRequests = 65'535;  ///< request numbers are 1 to 65535

int64_t read_clock(PtpScale scale) {
  timespec now{};
  clock_gettime(scale == PtpScale::kTai ? CLOCK_TAI : CLOCK_REALTIME, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

sockaddr_in broadcast_address(const StudioAction& action) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(io::kGvcpPort);
  inet_pton(AF_INET, action.broadcast.c_str(), &to.sin_addr);
  return to;
}

/// Reports the pulses whose commands were acknowledged.
class ActionSensor : public PulseSensor {
 public:
  explicit ActionSensor(std::shared_ptr<ActionAcknowledgements> acknowledgements)
      : acknowledgements_(std::move(acknowledgements)) {}
  void reset() override { acknowledgements_->reset(); }
  std::optional<SensedPulse> wait(MonotonicInstant deadline) override {
    return acknowledgements_->wait(deadline);
  }
  std::string fault() const override { return {}; }

 private:
  const std::shared_ptr<ActionAcknowledgements> acknowledgements_;
};

}  // namespace

ActionGenerator::ActionGenerator(StudioAction action, PtpNow ptp_now)
    : action_(std::move(action)),
      ptp_now_(ptp_now ? std::move(ptp_now)
                       : [scale = action_.clock] { return read_clock(scale); }),
      acknowledgements_(std::make_shared<ActionAcknowledgements>(action_.cameras)),
      train_(*this, HostClock()) {}

ActionGenerator::~ActionGenerator() {
  train_.plan({});  // ends the thread that sends
  stop_receiver();
}

void ActionGenerator::stop_receiver() {
  stopping_ = true;
  if (receiver_.joinable()) receiver_.join();
  stopping_ = false;
}

Duration ActionGenerator::lead() const {
  if (!is_scheduled()) return Duration::zero();
  return std::min(from_seconds(action_.lead_ms * 1e-3), period_of(plan_.rate_hz) / 2);
}

void ActionGenerator::open_socket() {
  socket_.reset(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  const sockaddr_in to = broadcast_address(action_);
  // A connected socket would receive no acknowledgement, so another one asks for the route.
  const io::UniqueFd probe(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  for (const int fd : {socket_.get(), probe.get()}) {
    if (setsockopt(fd, SOL_SOCKET, SO_BROADCAST, &on, sizeof on) == 0) continue;
    throw InputError(errno_message("action trigger: socket"));
  }
  if (connect(probe.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    throw InputError(errno_message("action trigger: " + action_.broadcast) +
                     "; expected the broadcast address of the network of the cameras");
  }
}

void ActionGenerator::arm(const PulseTrain& train) {
  check_train(train, "action trigger");
  train_.plan({});
  stop_receiver();
  plan_ = train;
  clock_fault_.clear();
  open_socket();
  acknowledgements_->reset();
  lock_memory();
  receiver_ = std::thread([this] { receive(); });
}

void ActionGenerator::start() {
  V3D_CHECK(socket_ && "arm() comes first");
  const Duration period = period_of(plan_.rate_hz);
  train_.plan({.period = period,
               .count = plan_.count,
               .skip_after = is_scheduled() ? lead() / 2 : period / kSkipDivisor});
  {
    const std::lock_guard lock(mutex_);
    offset_ns_.reset();
    last_pulse_ = {};
    unsent_ = 0;
    clock_was_set_ = false;
  }
  train_.start();
}

void ActionGenerator::stop() {
  train_.stop();
  MonotonicInstant last;
  {
    const std::lock_guard lock(mutex_);
    last = last_pulse_;
  }
  const HostClock clock;
  if (last > clock.now()) clock.sleep_until(last);
}

int64_t ActionGenerator::measure_offset() const {
  int64_t best = 0;
  Duration shortest = Duration::max();
  for (int i = 0; i < 8; ++i) {
    const MonotonicInstant before = Monotonic::now();
    const int64_t ptp = ptp_now_();
    const Duration took = Monotonic::now() - before;
    if (took >= shortest) continue;
    shortest = took;
    best = ptp - to_ns(before + took / 2);
  }
  return best;
}

bool ActionGenerator::begin_pulse(int64_t number, MonotonicInstant at) {
  const MonotonicInstant pulse = at + lead();
  io::ActionCommand command{.device_key = action_.keys.device_key,
                            .group_key = action_.keys.group_key,
                            .group_mask = action_.keys.group_mask,
                            .request = static_cast<uint16_t>(1 + number % kRequests)};
  const int64_t offset = is_scheduled() ? measure_offset() : 0;
  const std::lock_guard lock(mutex_);
  if (is_scheduled()) {
    if (!offset_ns_) offset_ns_ = offset;
    if (std::abs(offset - *offset_ns_) > kMaxSlew.count()) clock_was_set_ = true;
    command.time_ns = to_ns(pulse) + *offset_ns_;
  }
  last_pulse_ = pulse;
  acknowledgements_->sent(number, command.request, pulse);
  const std::vector<uint8_t> bytes = encode(command);
  const sockaddr_in to = broadcast_address(action_);
  if (sendto(socket_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT,
             reinterpret_cast<const sockaddr*>(&to), sizeof to) < 0) {
    send_error_ = errno_message(action_.broadcast);
    ++unsent_;
  }
  return true;
}

void ActionGenerator::receive() {
  make_thread_realtime();
  while (!stopping_) {
    const auto datagram = io::receive_action_datagram(socket_.get(), kPollInterval);
    acknowledgements_->expire(Monotonic::now());
    if (!datagram) continue;
    const auto acknowledgement = io::decode_action_acknowledgement(datagram->bytes);
    if (!acknowledgement) continue;
    acknowledgements_->received(ntohl(datagram->sender.sin_addr.s_addr), *acknowledgement,
                                Monotonic::now());
  }
}

std::optional<MonotonicInstant> ActionGenerator::first_pulse() const {
  const auto first = train_.first_pulse();
  return first ? std::optional(*first + lead()) : std::nullopt;
}

bool ActionGenerator::finished() const {
  if (!train_.finished()) return false;
  const std::lock_guard lock(mutex_);
  return Monotonic::now() >= last_pulse_;
}

std::string ActionGenerator::fault() const {
  // Read before mutex_ is locked: the thread of the train locks its own mutex first, then mutex_.
  const std::string late = train_.fault();
  const std::lock_guard lock(mutex_);
  if (unsent_ > 0) {
    return std::to_string(unsent_) + " action commands could not be sent: " + send_error_;
  }
  return clock_was_set_ ? "the clock of this PC was set during the train" : late;
}

PulseStatistics ActionGenerator::statistics() const {
  const AcknowledgementCounts counts = acknowledgements_->counts();
  PulseStatistics statistics = train_.statistics();
  statistics.acks_missing = counts.missing;
  statistics.acks_rejected = counts.rejected;
  return statistics;
}

std::string ActionGenerator::warning() const {
  std::string text = acknowledgements_->warning();
  if (is_scheduled()) return text;
  return text + (text.empty() ? "" : "; ") +
         "action commands have no scheduled time: " + clock_fault_;
}

std::unique_ptr<PulseSensor> ActionGenerator::own_sensor() {
  return std::make_unique<ActionSensor>(acknowledgements_);
}

}  // namespace v3d::trigger
