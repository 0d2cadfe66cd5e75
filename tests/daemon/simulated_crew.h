// Simulation of the nodes and operators of a studio, without cameras and sockets, on a network that
// loses, repeats and reorders messages. Time is simulated; equal seeds give equal results.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <random>
#include <string>
#include <vector>

#include "daemon/control/command_replay_filter.h"
#include "daemon/control/control.h"
#include "daemon/control/studio_coordinator.h"

namespace v3d::test {

class RandomSource {
 public:
  explicit RandomSource(uint32_t seed) : random_(seed) {}
  double uniform() { return std::uniform_real_distribution<>()(random_); }
  int64_t nonce() { return 1 + static_cast<int64_t>(random_()); }
  Duration between_ms(int min_ms, int max_ms) {
    return std::chrono::milliseconds(std::uniform_int_distribution<>(min_ms, max_ms)(random_));
  }

 private:
  std::mt19937 random_;
};

/// Probabilities, 0 to 1 each.
struct NetworkConditions {
  double loss = 0;
  double repeat = 0;
  double late = 0;  ///< of a delay of up to 2 s instead of up to 50 ms
};

/// Multicast: sends every message to all other members, unless it is lost.
class SimulatedNetwork {
 public:
  using Receiver = std::function<void(const wire::Bytes&, MonotonicInstant now)>;
  SimulatedNetwork(NetworkConditions conditions, RandomSource& random)
      : conditions_(conditions), random_(random) {}

  /// Returns the address for send().
  size_t join(Receiver receiver) {
    receivers_.push_back(std::move(receiver));
    return receivers_.size() - 1;
  }
  void send(size_t from, const wire::Bytes& bytes, MonotonicInstant now) {
    for (size_t to = 0; to < receivers_.size(); ++to) {
      if (to == from) continue;
      if (random_.uniform() >= conditions_.loss) enqueue(to, bytes, now);
      if (random_.uniform() < conditions_.repeat) enqueue(to, bytes, now);
    }
  }
  void deliver(MonotonicInstant now) {
    while (!in_flight_.empty() && in_flight_.top().arrives <= now) {
      const Packet packet = in_flight_.top();
      in_flight_.pop();
      receivers_[packet.to](packet.bytes, now);
    }
  }
  bool empty() const { return in_flight_.empty(); }

 private:
  struct Packet {
    MonotonicInstant arrives;
    int64_t number;
    size_t to;
    wire::Bytes bytes;
    bool operator<(const Packet& other) const {
      return std::tie(other.arrives, other.number) < std::tie(arrives, number);
    }
  };
  void enqueue(size_t to, const wire::Bytes& bytes, MonotonicInstant now) {
    const bool late = random_.uniform() < conditions_.late;
    in_flight_.push({now + random_.between_ms(1, late ? 2000 : 50), ++enqueued_, to, bytes});
  }

  const NetworkConditions conditions_;
  RandomSource& random_;
  std::vector<Receiver> receivers_;
  std::priority_queue<Packet> in_flight_;
  int64_t enqueued_ = 0;
};

/// State that all simulated processes share.
struct Simulation {
  RandomSource random;
  SimulatedNetwork network;
  wire::StudioKey key = wire::StudioKey::make();
  Simulation(uint32_t seed, NetworkConditions conditions)
      : random(seed), network(conditions, random) {}

  static RealtimeInstant wall_clock(MonotonicInstant now) {
    return from_ns<Realtime>(1'700'000'000'000'000'000 + to_ns(now));
  }
};

/// A node whose work takes a random time and always succeeds.
class SimulatedNode {
 public:
  SimulatedNode(Simulation& simulation, std::string name)
      : simulation_(simulation),
        name_(std::move(name)),
        clock_error_(simulation.random.between_ms(-400, 400)) {
    address_ = simulation.network.join(
        [this](const wire::Bytes& bytes, MonotonicInstant now) { receive(bytes, now); });
    restart(from_ns<Monotonic>(0) - std::chrono::minutes(1));
  }

  /// Restarts the process: only the persisted order remains.
  void restart(MonotonicInstant now) {
    controller_.emplace(name_);
    if (persisted_) controller_->set_last_result(persisted_->take, "recovered", "{}");
    trigger_known_at_ = now + simulation_.random.between_ms(0, 1500);
    filter_ = std::make_unique<control::CommandReplayFilter>(
        name_, [this] { return simulation_.random.nonce(); });
    filter_->credentials().set_studio_key(simulation_.key, now);
    due_.reset();
    may_rejoin_ = persisted_.has_value();
  }
  /// Called when this node starts pulses.
  std::function<void(const std::string& take)> on_start;
  /// Whether the trigger's node is armed for a take or records it; null on that node.
  std::function<bool(const std::string& take)> trigger_runs;
  /// Whether the trigger's node records the take; null on that node.
  std::function<bool(const std::string& take)> trigger_records;

  void tick(MonotonicInstant now) {
    if (due_ && due_->first <= now) {
      const control::Input event = due_->second;
      due_.reset();
      execute(controller_->on_event(event, "report"), now);
    }
    monitor_train(now);
    rejoin(now);
    if (phase() != control::Phase::kPrepared) prepared_since_ = now;
    if (now - prepared_since_ > std::chrono::seconds(60)) {
      execute(controller_->on_event(control::Input::kExpired, "not confirmed"), now);
    }
  }

  /// Pulses for learning the background have started.
  void on_pulses(MonotonicInstant now) {
    if (phase() == control::Phase::kLearning)
      due_ = {now + simulation_.random.between_ms(500, 900), control::Input::kReady};
  }

  control::Phase phase() const { return controller_->phase(); }
  const std::string& take() const { return controller_->order().take; }
  control::CommandCounts counts() const { return filter_->counts(); }

 private:
  RealtimeInstant clock(MonotonicInstant now) const {
    return Simulation::wall_clock(now) + clock_error_;
  }
  void receive(const wire::Bytes& bytes, MonotonicInstant now) {
    const auto admitted = filter_->admit(bytes, now);
    if (!admitted) return;
    if (admitted->is_current) return execute(controller_->on_command(admitted->command), now);
    reply(filter_->nonce_reply(admitted->command, now), now);
  }
  void execute(const control::Controller::Step& step, MonotonicInstant now) {
    start_work(step.work, now);
    for (const wire::ReplyMessage& message : step.replies) reply(message, now);
  }
  void reply(wire::ReplyMessage message, MonotonicInstant now) {
    message.sent = clock(now);
    message.nonce = filter_->nonce(now);
    simulation_.network.send(address_, encode_with_mac(message, simulation_.key), now);
  }
  void start_work(control::Work work, MonotonicInstant now) {
    const auto schedule = [&](int min_ms, int max_ms, control::Input event) {
      due_ = {now + simulation_.random.between_ms(min_ms, max_ms), event};
    };
    switch (work) {
      case control::Work::kArm:
      case control::Work::kLearn:
        persisted_.reset();
        may_rejoin_ = false;
        return schedule(10, 800, control::Input::kReady);
      case control::Work::kStart:
        if (controller_->order().verb == wire::CommandVerb::kArm) persisted_ = controller_->order();
        if (on_start) on_start(take());
        return;
      case control::Work::kDrain:
        return schedule(100, 1500, control::Input::kDrained);
      case control::Work::kDisarm:
        return due_.reset();
      case control::Work::kNone:
        return;
    }
  }
  void rejoin(MonotonicInstant now) {
    if (!may_rejoin_ || !trigger_records) return;
    if (phase() != control::Phase::kIdle || now < trigger_known_at_) return;
    may_rejoin_ = false;
    if (trigger_records(persisted_->take)) controller_->rejoined(*persisted_);
  }
  /// Reports the end of the train, as the health of the trigger's node shows it.
  void monitor_train(MonotonicInstant now) {
    const bool runs =
        phase() != control::Phase::kRecording || !trigger_runs || trigger_runs(take());
    if (runs) train_ran_ = now;
    if (now - train_ran_ > std::chrono::milliseconds(1500)) {
      train_ran_ = now;
      execute(controller_->on_event(control::Input::kTrainEnded, "pulses have ended"), now);
    }
  }

  Simulation& simulation_;
  const std::string name_;
  const Duration clock_error_;
  size_t address_ = 0;
  std::optional<control::Controller> controller_;
  std::unique_ptr<control::CommandReplayFilter> filter_;
  std::optional<std::pair<MonotonicInstant, control::Input>> due_;
  MonotonicInstant prepared_since_;
  MonotonicInstant train_ran_;
  std::optional<wire::CommandMessage> persisted_;  ///< order of the last take, on disk
  bool may_rejoin_ = false;                        ///< into the take of persisted_ after a restart
  MonotonicInstant trigger_known_at_;
};

/// Executes orders in sequence, and stops after an order that failed.
class SimulatedOperator {
 public:
  SimulatedOperator(Simulation& simulation, std::string name, control::CommandTargets studio,
                    MonotonicInstant starts_at)
      : simulation_(simulation),
        name_(std::move(name)),
        studio_(std::move(studio)),
        idle_until_(starts_at) {
    address_ = simulation.network.join([this](const wire::Bytes& bytes, MonotonicInstant) {
      const auto reply = wire::decode<wire::ReplyMessage>(bytes);
      if (!coordinator_ || !reply || !simulation_.key.has_valid_mac(bytes)) return;
      if (reply->command_sender == name_) coordinator_->on_reply(*reply);
    });
  }

  void add_order(wire::CommandVerb verb, const std::string& take = {}) {
    wire::CommandMessage order;
    order.verb = verb;
    order.take = take;
    orders_.push_back(order);
  }
  void tick(MonotonicInstant now) {
    if (!coordinator_) {
      if (orders_.empty() || now < idle_until_) return;
      coordinator_.emplace(orders_.front(), counter_, studio_, now + std::chrono::seconds(25),
                           nonces_);
    }
    if (const auto message = coordinator_->poll(now)) send(*message, now);
    if (!coordinator_->is_finished()) return;
    answers.push_back(coordinator_->answer());
    counter_ = coordinator_->counter();
    nonces_ = coordinator_->nonces();
    coordinator_.reset();
    orders_.erase(orders_.begin());
    if (!answers.back().done()) orders_.clear();
    idle_until_ = now + simulation_.random.between_ms(0, 2000);
  }
  bool finished() const { return orders_.empty(); }

  std::vector<control::Answer> answers;

 private:
  void send(wire::CommandMessage message, MonotonicInstant now) {
    message.sender = name_;
    last_sent_ = std::max(Simulation::wall_clock(now), last_sent_ + std::chrono::microseconds(1));
    message.sent = last_sent_;
    simulation_.network.send(address_, encode_with_mac(message, simulation_.key), now);
  }

  Simulation& simulation_;
  const std::string name_;
  const control::CommandTargets studio_;
  size_t address_ = 0;
  int64_t counter_ = 0;
  control::NodeNonces nonces_;
  RealtimeInstant last_sent_;
  MonotonicInstant idle_until_;
  std::vector<wire::CommandMessage> orders_;
  std::optional<control::StudioCoordinator> coordinator_;
};

/// A studio of nodes cap01, which has the trigger, to cap0N.
class SimulatedStudio {
 public:
  SimulatedStudio(uint32_t seed, NetworkConditions conditions, int node_count)
      : simulation_(seed, conditions) {
    for (int i = 1; i <= node_count; ++i) studio_.nodes.push_back("cap0" + std::to_string(i));
    studio_.trigger = studio_.nodes.front();
    for (const std::string& name : studio_.nodes) {
      nodes.push_back(std::make_unique<SimulatedNode>(simulation_, name));
      if (nodes.size() > 1)
        nodes.back()->trigger_records = [this](const auto& take) {
          return nodes.front()->take() == take &&
                 nodes.front()->phase() == control::Phase::kRecording;
        };
      if (nodes.size() > 1)
        nodes.back()->trigger_runs = [this](const auto& take) {
          const SimulatedNode& trigger = *nodes.front();
          const control::Phase phase = trigger.phase();
          return trigger.take() == take &&
                 (phase == control::Phase::kArmed || phase == control::Phase::kRecording);
        };
    }
    nodes.front()->on_start = [this](const std::string& take) { record_start(take); };
  }

  SimulatedOperator& add_operator(const std::string& name, Duration start) {
    operators.push_back(
        std::make_unique<SimulatedOperator>(simulation_, name, studio_, now_ + start));
    return *operators.back();
  }
  /// Runs until all orders are finished and all timeouts of nodes have expired.
  void run_until_idle() {
    while (!is_quiet()) step();
    // Prepared nodes without a commit return to idle after 60 s.
    const MonotonicInstant end = now_ + std::chrono::seconds(65);
    while (now_ < end) step();
  }
  void run_for(Duration duration) {
    const MonotonicInstant end = now_ + duration;
    while (now_ < end) step();
  }
  MonotonicInstant now() const { return now_; }

  bool all_are(control::Phase phase) const {
    return std::all_of(nodes.begin(), nodes.end(),
                       [&](const auto& node) { return node->phase() == phase; });
  }
  std::vector<std::unique_ptr<SimulatedNode>> nodes;
  std::vector<std::unique_ptr<SimulatedOperator>> operators;
  std::vector<std::string> takes;  ///< takes and backgrounds with pulses, in order
  bool pulses_only_where_all_record = true;

 private:
  void step() {
    now_ += std::chrono::milliseconds(5);
    simulation_.network.deliver(now_);
    for (const auto& node : nodes) node->tick(now_);
    for (const auto& person : operators) person->tick(now_);
  }
  bool is_quiet() const {
    return simulation_.network.empty() && std::all_of(operators.begin(), operators.end(),
                                                      [](const auto& o) { return o->finished(); });
  }
  void record_start(const std::string& take) {
    takes.push_back(take);
    for (const auto& node : nodes) node->on_pulses(now_);
    for (size_t i = 1; i < nodes.size(); ++i) {
      const control::Phase phase = nodes[i]->phase();
      const bool records =
          phase == control::Phase::kRecording || phase == control::Phase::kLearning;
      if (!records || nodes[i]->take() != take) pulses_only_where_all_record = false;
    }
  }

  Simulation simulation_;
  control::CommandTargets studio_;
  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
};

}  // namespace v3d::test
