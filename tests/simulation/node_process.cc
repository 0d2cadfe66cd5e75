#include "simulation/node_process.h"

#include <algorithm>
#include <utility>

#include "base/core/bytes.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/take_folder.h"
#include "take/ledger/verify.h"

namespace v3d::simulation {
namespace {

/// A message with its session stamp in front. Real datagrams hold the stamp in their trailer.
struct StampedMessage {
  bus::SessionStamp stamp;
  std::span<const uint8_t> message;
};
constexpr size_t kStampSize = 16;

wire::Bytes put_stamp(const bus::SessionStamp& stamp, const wire::Bytes& message) {
  wire::Bytes bytes(kStampSize);
  write_big_endian(stamp.session, std::span(bytes).subspan(0, 4));
  write_big_endian(stamp.sequence, std::span(bytes).subspan(4, 4));
  write_big_endian(static_cast<uint64_t>(to_ns(stamp.sent)), std::span(bytes).subspan(8, 8));
  bytes.insert(bytes.end(), message.begin(), message.end());
  return bytes;
}

StampedMessage take_stamp(std::span<const uint8_t> bytes) {
  const auto number = [&](size_t at, size_t size) {
    return read_big_endian(bytes.subspan(at, size));
  };
  return {{.session = static_cast<uint32_t>(number(0, 4)),
           .sequence = static_cast<uint32_t>(number(4, 4)),
           .sent = from_ns<Realtime>(static_cast<int64_t>(number(8, 8)))},
          bytes.subspan(kStampSize)};
}

Cause cause_of(const wire::CommandMessage& command) {
  if (command.verb == wire::CommandVerb::kAbort && command.own_only) return Cause::kTakeBack;
  const bool ends =
      command.verb == wire::CommandVerb::kStop || command.verb == wire::CommandVerb::kAbort;
  return ends ? Cause::kStopOrAbort : Cause::kOtherCommand;
}

std::string text_of(const wire::CommandMessage& command) {
  return std::string(name(command.verb)) + " " + command.take + (command.own_only ? " own" : "") +
         " from " + order_id(command);
}

}  // namespace

NodeProcess::NodeProcess(World& world, Trace& trace, Host host, bool is_trigger)
    : world_(world), trace_(trace), host_(std::move(host)), is_trigger_(is_trigger) {
  const auto interest = [this](Channel channel, size_t from) {
    if (channel == Channel::kCommand || channel == Channel::kSession) return true;
    if (channel == Channel::kReply) return false;
    if (is_trigger_) return channel == Channel::kHealth && host_.captures;
    return from == trigger_place_ && (channel == Channel::kHealth || host_.captures);
  };
  place_ =
      world_.network.join(interest, [this](Channel channel, size_t from, const wire::Bytes& bytes) {
        receive(channel, from, bytes);
      });
}

// --- the process --------------------------------------------------------------------------------

void NodeProcess::boot() {
  if (is_up()) return;
  trace_.add([&] { return host_.name + " starts"; });
  recover_takes();
  if (host_.captures) {
    work_ = std::make_unique<SimulatedCapture>(world_, host_);
  } else {
    work_ = std::make_unique<SimulatedRecon>(world_, host_);
  }
  clock_error_ = host_.clock_error;
  filter_ = std::make_unique<control::CommandReplayFilter>(host_.name,
                                                           [this] { return world_.draws.nonce(); });
  filter_->credentials().set_studio_key(world_.key, world_.time.now());
  session_ = static_cast<uint32_t>(world_.draws.nonce());
  sequence_ = 0;
  sessions_ = {};
  challenges_ = {};
  pulse_seq_ = 0;
  commands_.clear();
  waiting_.clear();
  waiting_of_.clear();
  is_paused_ = is_ending_ = false;
  protocol_ = std::make_unique<control::NodeProtocol>(
      host_.name, *work_, [this](wire::ReplyMessage reply) { publish(std::move(reply)); },
      world_.time.now());
  for (const auto& [name, order] : host_.disk.persisted_commands()) {
    const TakeOnDisk& take = host_.disk.takes.at(name);
    if (!host_.captures) protocol_->set_last_result(name, "meshes recovered", "{}");
    if (!take.ledger) continue;
    protocol_->set_last_result(name, "recovered " + take.ledger->verdict(),
                               control::ledger_detail(*take.ledger));
  }
  plan_turn(world_.time.now());
}

/// Recovers open takes, as recover_open_takes() does with files.
void NodeProcess::recover_takes() {
  if (!host_.captures) return;
  for (auto& [name, take] : host_.disk.takes) {
    take::TakeInfo info;
    info.state = take.is_open ? take::TakeState::kRecording : take::TakeState::kComplete;
    info.cameras = take.cameras;
    if (!node::is_open_take_of(info, host_.cameras, take.persisted_order.has_value())) continue;
    take::Ledger ledger;
    ledger.take = name;
    take::PulseEvidence evidence{.sensed = take.pulses, .has_sense_line = world_.has_sense_line};
    for (const std::string& camera : take.cameras) {
      for (const int64_t pulse : take.frames[camera]) {
        evidence.last_labelled = std::max(evidence.last_labelled, pulse);
      }
    }
    recount_pulses(evidence, take.ledger, ledger);
    for (const std::string& camera : take.cameras) {
      ledger.cameras.push_back(take::account(camera, take.frames[camera], {}, ledger.commanded));
    }
    take.ledger = ledger;
    take.is_open = false;
  }
}

/// Stops the trigger when its node ends: the exact number of pulses is then lost.
void NodeProcess::stop_lost_trigger() {
  if (host_.trigger == nullptr) return;
  if (phase() == control::Phase::kRecording || phase() == control::Phase::kDraining)
    world_.truth.on_trigger_lost();
  host_.trigger->stop();
}

void NodeProcess::end(Cause cause) {
  stop_lost_trigger();
  world_.truth.on_change({.node = host_.name,
                          .from = protocol_->phase(),
                          .to = control::Phase::kIdle,
                          .order = protocol_->order(),
                          .cause = cause,
                          .command = {}});
  world_.events.on_crash(host_.name);
  protocol_.reset();
  work_.reset();
  filter_.reset();
  ++turn_;
}

void NodeProcess::crash() {
  if (!is_up()) return;
  trace_.add([&] { return host_.name + " crashes"; });
  end(Cause::kEnded);
}

void NodeProcess::ask_to_end() {
  if (!is_up() || is_ending_) return;
  trace_.add([&] { return host_.name + " is asked to exit"; });
  resume();
  is_ending_ = true;
  if (phase() == control::Phase::kRecording && host_.trigger != nullptr)
    world_.truth.on_trigger_lost();
  run_observed(Cause::kEnded, {}, [&] { protocol_->begin_shutdown(world_.time.now()); });
  plan_turn(world_.time.now());
}

void NodeProcess::pause() {
  if (!is_up()) return;
  trace_.add([&] { return host_.name + " is paused"; });
  is_paused_ = true;
}

void NodeProcess::resume() {
  if (!is_up() || !is_paused_) return;
  trace_.add([&] { return host_.name + " resumes"; });
  is_paused_ = false;
  waiting_of_.clear();
  for (const auto& handle : std::exchange(waiting_, {})) handle();
  plan_turn(world_.time.now());
}

// --- receiving ----------------------------------------------------------------------------------

void NodeProcess::receive(Channel channel, size_t from, const wire::Bytes& bytes) {
  if (!is_up()) return;
  if (is_paused_) {
    waiting_.emplace_back([this, channel, from, bytes] { process(channel, from, bytes); });
    return;
  }
  process(channel, from, bytes);
}

void NodeProcess::on_sensed(int64_t pulse) {
  const auto handle = [this, pulse, edge = clock()] {
    work_->on_sensed(pulse);
    send_pulse(pulse, edge);
  };
  if (!is_paused_) return handle();
  if (waiting_of_["edges"]++ < kMaxWaiting) waiting_.emplace_back(handle);
}

void NodeProcess::on_frame(const std::string& camera, int64_t pulse) {
  if (!is_paused_) return work_->on_frame(camera, pulse);
  if (waiting_of_["camera " + camera]++ >= kMaxWaiting) return;
  waiting_.emplace_back([this, camera, pulse] { work_->on_frame(camera, pulse); });
}

void NodeProcess::process(Channel channel, size_t from, const wire::Bytes& bytes) {
  if (channel == Channel::kCommand) {
    auto admitted = filter_->admit(bytes, world_.time.now());
    if (!admitted) return;
    commands_.push_back(std::move(*admitted));
    plan_turn(world_.time.now());
    return;
  }
  const auto [stamp, message] = take_stamp(bytes);
  if (channel == Channel::kSession) {
    on_session_message(*wire::decode<wire::SessionMessage>(message), stamp);
  } else if (accepts(stamp)) {
    if (channel == Channel::kPulse)
      work_->on_pulse_message(*wire::decode<wire::PulseMessage>(message));
    if (channel != Channel::kHealth) return;
    const node::ReceivedHealth health = {
        .health = *wire::decode<wire::HealthMessage>(message),
        .session = stamp.session,
        .received = world_.time.now(),
        .sent = world_.time.now() - sessions_.age(stamp, receiver_time())};
    if (from == trigger_place_) work_->on_trigger_health(health);
    work_->on_other_health(health);
  }
}

/// Accepts or rejects health and pulses, as MessageReceiver does.
bool NodeProcess::accepts(const bus::SessionStamp& stamp) {
  if (sessions_.is_received(stamp)) return false;
  const bool is_accepted =
      sessions_.is_recent(stamp, receiver_time()) && sessions_.has_responded(stamp.session);
  const bool seems_old =
      sessions_.age(stamp, receiver_time()) > bus::SessionReplayFilter::kSeemsOld;
  if (is_accepted) sessions_.note(stamp, receiver_time());
  if (is_accepted && !seems_old) return true;
  if (const auto nonce = challenges_.issue(stamp.session, world_.time.now())) {
    send(Channel::kSession,
         encode(wire::SessionMessage{.sent = clock(), .session = stamp.session, .nonce = *nonce}));
  }
  return is_accepted;
}

void NodeProcess::on_session_message(const wire::SessionMessage& message,
                                     const bus::SessionStamp& stamp) {
  if (!message.is_answer) {
    if (message.session != session_) return;
    wire::SessionMessage response = message;
    response.newest = sequence_;
    response.is_answer = true;
    return send(Channel::kSession, encode(response));
  }
  const auto since_challenge =
      challenges_.pop_matching(message.session, message.nonce, world_.time.now());
  if (!since_challenge) return;
  sessions_.accept({.session = message.session, .sequence = message.newest, .sent = stamp.sent},
                   receiver_time(), *since_challenge);
}

void NodeProcess::send(Channel channel, const wire::Bytes& message) {
  const bus::SessionStamp stamp{.session = session_, .sequence = ++sequence_, .sent = clock()};
  world_.network.send(place_, channel, put_stamp(stamp, message));
}

// --- the loop, as in NodeLoop -------------------------------------------------------------------

void NodeProcess::plan_turn(MonotonicInstant at) {
  world_.time.at(at, [this, number = ++turn_] {
    if (number == turn_ && is_up() && !is_paused_) turn();
  });
}

void NodeProcess::turn() {
  const MonotonicInstant now = world_.time.now();
  if (!commands_.empty()) {
    const control::CommandReplayFilter::Admitted admitted = std::move(commands_.front());
    const wire::CommandMessage& command = admitted.command;
    commands_.pop_front();
    if (admitted.is_current) {
      run_observed(cause_of(command), command, [&] { protocol_->on_command(command); });
    } else {
      publish(filter_->nonce_reply(command, now));
    }
  }
  if (protocol_->is_health_due(now)) publish_health();
  run_observed(Cause::kReport, {}, [&] { protocol_->poll(now, true); });
  if (protocol_->is_health_due(now)) publish_health();
  if (is_ending_ && protocol_->may_shut_down(now)) {
    work_->disarm();
    return end(Cause::kEnded);
  }
  plan_turn(commands_.empty() ? protocol_->next_poll(now) : now);
}

/// Runs the action and reports the change of phase to Truth and ProtocolEvents.
void NodeProcess::run_observed(Cause cause, const wire::CommandMessage& command,
                               const std::function<void()>& action) {
  const control::Phase before = protocol_->phase();
  wire::CommandMessage order = protocol_->order();
  action();
  const control::Phase after = protocol_->phase();
  if (!command.sender.empty()) world_.events.on_command(host_.name, command, after);
  if (before == after) return;
  if (before == control::Phase::kIdle) order = protocol_->order();
  if (cause == Cause::kReport && after == control::Phase::kRecording) cause = Cause::kRejoined;
  if (cause == Cause::kReport && work_->ended_by_disk()) cause = Cause::kDisk;
  const bool may_end = cause == Cause::kDisk || cause == Cause::kEnded;
  if (command.sender.empty()) world_.events.on_report(host_.name, order, after, may_end);
  trace_.add([&] {
    return host_.name + ": " + std::string(name(before)) + " -> " + std::string(name(after)) +
           " (" + order.take + ", " + (command.sender.empty() ? "report" : text_of(command)) + ")";
  });
  world_.truth.on_change({.node = host_.name,
                          .from = before,
                          .to = after,
                          .order = order,
                          .cause = cause,
                          .command = command});
}

// --- sending ------------------------------------------------------------------------------------

void NodeProcess::publish(wire::ReplyMessage reply) {
  world_.events.on_reply(reply);
  reply.sent = clock();
  reply.nonce = filter_->nonce(world_.time.now());
  world_.network.send(place_, Channel::kReply, encode_with_mac(reply, world_.key));
}

void NodeProcess::publish_health() {
  wire::HealthMessage health = protocol_->health(world_.time.now());
  if (health.state == wire::NodeState::kIdle) clock_error_ = host_.clock_error;
  health.sent = clock();
  send(Channel::kHealth, encode(health));
}

void NodeProcess::send_pulse(int64_t pulse, RealtimeInstant edge) {
  wire::PulseMessage message;
  message.sent = clock();
  message.edge = edge;
  message.seq = pulse_seq_++;
  message.take = protocol_->order().take;
  message.pulse = pulse;
  const wire::Bytes bytes = encode(message);
  send(Channel::kPulse, bytes);
  repeat_pulse(bytes, pulse_seq_, 3);
}

void NodeProcess::repeat_pulse(const wire::Bytes& bytes, int64_t seq, int times) {
  constexpr Duration kAgainAfter = std::chrono::milliseconds(50);
  if (times == 0) return;
  world_.time.after(kAgainAfter, [this, bytes, seq, times] {
    if (!is_up() || is_paused_ || pulse_seq_ != seq) return;
    send(Channel::kPulse, bytes);
    repeat_pulse(bytes, seq, times - 1);
  });
}

}  // namespace v3d::simulation
