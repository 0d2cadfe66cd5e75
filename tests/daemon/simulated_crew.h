// Nodes and operators of a studio without cameras and sockets, and a network between them that
// loses, repeats and reorders. Time is simulated; one seed gives one story.
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

#include "daemon/control/command_gate.h"
#include "daemon/control/control.h"
#include "daemon/control/studio_coordinator.h"

namespace v3d::test {

class Dice {
 public:
  explicit Dice(uint32_t seed) : random_(seed) {}
  double part() { return std::uniform_real_distribution<>()(random_); }
  int64_t nonce() { return 1 + static_cast<int64_t>(random_()); }
  Duration between_ms(int least, int most) {
    return std::chrono::milliseconds(std::uniform_int_distribution<>(least, most)(random_));
  }

 private:
  std::mt19937 random_;
};

struct Weather {
  double loss = 0;
  double repeat = 0;
  double late = 0;  ///< of messages that take up to two seconds instead of up to 50 ms
};

/// Everybody hears every message, or not.
class SimulatedNetwork {
 public:
  using Ear = std::function<void(const Bytes&, MonotonicInstant now)>;
  SimulatedNetwork(Weather weather, Dice& dice) : weather_(weather), dice_(dice) {}

  /// Returns what send() takes.
  size_t join(Ear ear) {
    ears_.push_back(std::move(ear));
    return ears_.size() - 1;
  }
  void send(size_t from, const Bytes& bytes, MonotonicInstant now) {
    for (size_t to = 0; to < ears_.size(); ++to) {
      if (to == from) continue;
      if (dice_.part() >= weather_.loss) post(to, bytes, now);
      if (dice_.part() < weather_.repeat) post(to, bytes, now);
    }
  }
  void deliver(MonotonicInstant now) {
    while (!flying_.empty() && flying_.top().arrives <= now) {
      const Letter letter = flying_.top();
      flying_.pop();
      ears_[letter.to](letter.bytes, now);
    }
  }
  bool empty() const { return flying_.empty(); }

 private:
  struct Letter {
    MonotonicInstant arrives;
    int64_t number;
    size_t to;
    Bytes bytes;
    bool operator<(const Letter& other) const {
      return std::tie(other.arrives, other.number) < std::tie(arrives, number);
    }
  };
  void post(size_t to, const Bytes& bytes, MonotonicInstant now) {
    const bool late = dice_.part() < weather_.late;
    flying_.push({now + dice_.between_ms(1, late ? 2000 : 50), ++posted_, to, bytes});
  }

  const Weather weather_;
  Dice& dice_;
  std::vector<Ear> ears_;
  std::priority_queue<Letter> flying_;
  int64_t posted_ = 0;
};

/// What hosts have in common.
struct World {
  Dice dice;
  SimulatedNetwork network;
  StudioKey key = StudioKey::make();
  World(uint32_t seed, Weather weather) : dice(seed), network(weather, dice) {}

  static RealtimeInstant wall_clock(MonotonicInstant now) {
    return from_ns<Realtime>(1'700'000'000'000'000'000 + to_ns(now));
  }
};

/// A node whose work takes its time and always succeeds.
class SimulatedNode {
 public:
  SimulatedNode(World& world, std::string name)
      : world_(world), name_(std::move(name)), clock_error_(world.dice.between_ms(-400, 400)) {
    place_ =
        world.network.join([this](const Bytes& bytes, MonotonicInstant now) { hear(bytes, now); });
    start_anew(from_ns<Monotonic>(0) - std::chrono::minutes(1));
  }

  /// Everything that was in memory is gone. On its disk is the take it was at, and what it had of
  /// it.
  void start_anew(MonotonicInstant now) {
    controller_.emplace(name_);
    if (kept_) controller_->remember(kept_->take, "recovered", "{}");
    hears_of_trigger_ = now + world_.dice.between_ms(0, 1500);
    gate_ = std::make_unique<CommandGate>(name_, [this] { return world_.dice.nonce(); });
    gate_->credentials().set_studio_key(world_.key, now);
    due_.reset();
    may_rejoin_ = kept_.has_value();
  }
  /// Called when pulses begin here.
  std::function<void(const std::string& take)> on_start;
  /// Whether the node of the trigger is armed or records for a take; null there.
  std::function<bool(const std::string& take)> trigger_runs;
  /// Whether it records for the take; null there.
  std::function<bool(const std::string& take)> trigger_records;

  void tick(MonotonicInstant now) {
    if (due_ && due_->first <= now) {
      const Input event = due_->second;
      due_.reset();
      act(controller_->on_event(event, "report"), now);
    }
    watch_train(now);
    rejoin(now);
    if (phase() != Phase::kPrepared) prepared_since_ = now;
    if (now - prepared_since_ > std::chrono::seconds(60)) {
      act(controller_->on_event(Input::kExpired, "not confirmed"), now);
    }
  }

  /// Enough of them to learn from.
  void see_pulses(MonotonicInstant now) {
    if (phase() == Phase::kLearning) due_ = {now + world_.dice.between_ms(500, 900), Input::kReady};
  }

  Phase phase() const { return controller_->phase(); }
  const std::string& take() const { return controller_->order().take; }
  CommandCounts counts() const { return gate_->counts(); }

 private:
  RealtimeInstant clock(MonotonicInstant now) const {
    return World::wall_clock(now) + clock_error_;
  }
  void hear(const Bytes& bytes, MonotonicInstant now) {
    const auto admitted = gate_->admit(bytes, now);
    if (!admitted) return;
    if (admitted->is_current) return act(controller_->on_command(admitted->command), now);
    reply(gate_->nonce_reply(admitted->command, now), now);
  }
  void act(const Controller::Step& step, MonotonicInstant now) {
    begin(step.work, now);
    for (const ReplyMessage& said : step.replies) reply(said, now);
  }
  void reply(ReplyMessage message, MonotonicInstant now) {
    message.sent = clock(now);
    message.nonce = gate_->nonce(now);
    world_.network.send(place_, encode_sealed(message, world_.key), now);
  }
  void begin(Work work, MonotonicInstant now) {
    const auto later = [&](int least, int most, Input event) {
      due_ = {now + world_.dice.between_ms(least, most), event};
    };
    switch (work) {
      case Work::kArm:
      case Work::kLearn:
        kept_.reset();
        may_rejoin_ = false;
        return later(10, 800, Input::kReady);
      case Work::kStart:
        if (controller_->order().verb == CommandVerb::kArm) kept_ = controller_->order();
        if (on_start) on_start(take());
        return;
      case Work::kDrain:
        return later(100, 1500, Input::kDrained);
      case Work::kDisarm:
        return due_.reset();
      case Work::kNone:
        return;
    }
  }
  void rejoin(MonotonicInstant now) {
    if (!may_rejoin_ || !trigger_records) return;
    if (phase() != Phase::kIdle || now < hears_of_trigger_) return;
    may_rejoin_ = false;
    if (trigger_records(kept_->take)) controller_->rejoined(*kept_);
  }
  /// As by the health of the trigger's node.
  void watch_train(MonotonicInstant now) {
    const bool runs = phase() != Phase::kRecording || !trigger_runs || trigger_runs(take());
    if (runs) train_ran_ = now;
    if (now - train_ran_ > std::chrono::milliseconds(1500)) {
      train_ran_ = now;
      act(controller_->on_event(Input::kTrainEnded, "pulses have ended"), now);
    }
  }

  World& world_;
  const std::string name_;
  const Duration clock_error_;
  size_t place_ = 0;
  std::optional<Controller> controller_;
  std::unique_ptr<CommandGate> gate_;
  std::optional<std::pair<MonotonicInstant, Input>> due_;
  MonotonicInstant prepared_since_;
  MonotonicInstant train_ran_;
  std::optional<CommandMessage> kept_;  ///< on its disk: of its last take, be it over or not
  bool may_rejoin_ = false;             ///< with what was kept when it was started anew
  MonotonicInstant hears_of_trigger_;
};

/// Says one order after the other, and stops after one that failed.
class SimulatedOperator {
 public:
  SimulatedOperator(World& world, std::string name, CommandTargets studio, MonotonicInstant begins)
      : world_(world), name_(std::move(name)), studio_(std::move(studio)), idle_until_(begins) {
    place_ = world.network.join([this](const Bytes& bytes, MonotonicInstant) {
      const auto reply = decode<ReplyMessage>(bytes);
      if (!coordinator_ || !reply || !world_.key.has_sealed(bytes)) return;
      if (reply->command_sender == name_) coordinator_->on_reply(*reply);
    });
  }

  void will_say(CommandVerb verb, const std::string& take = {}) {
    CommandMessage order;
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
    idle_until_ = now + world_.dice.between_ms(0, 2000);
  }
  bool finished() const { return orders_.empty(); }

  std::vector<Answer> answers;

 private:
  void send(CommandMessage message, MonotonicInstant now) {
    message.sender = name_;
    last_sent_ = std::max(World::wall_clock(now), last_sent_ + std::chrono::microseconds(1));
    message.sent = last_sent_;
    world_.network.send(place_, encode_sealed(message, world_.key), now);
  }

  World& world_;
  const std::string name_;
  const CommandTargets studio_;
  size_t place_ = 0;
  int64_t counter_ = 0;
  NodeNonces nonces_;
  RealtimeInstant last_sent_;
  MonotonicInstant idle_until_;
  std::vector<CommandMessage> orders_;
  std::optional<StudioCoordinator> coordinator_;
};

/// "cap01" with the trigger, and others.
class SimulatedCrew {
 public:
  SimulatedCrew(uint32_t seed, Weather weather, int node_count) : world_(seed, weather) {
    for (int i = 1; i <= node_count; ++i) studio_.nodes.push_back("cap0" + std::to_string(i));
    studio_.trigger = studio_.nodes.front();
    for (const std::string& name : studio_.nodes) {
      nodes.push_back(std::make_unique<SimulatedNode>(world_, name));
      if (nodes.size() > 1)
        nodes.back()->trigger_records = [this](const auto& take) {
          return nodes.front()->take() == take && nodes.front()->phase() == Phase::kRecording;
        };
      if (nodes.size() > 1)
        nodes.back()->trigger_runs = [this](const auto& take) {
          const SimulatedNode& trigger = *nodes.front();
          const Phase phase = trigger.phase();
          return trigger.take() == take && (phase == Phase::kArmed || phase == Phase::kRecording);
        };
    }
    nodes.front()->on_start = [this](const std::string& take) { note_start(take); };
  }

  SimulatedOperator& add_operator(const std::string& name, Duration begins) {
    operators.push_back(std::make_unique<SimulatedOperator>(world_, name, studio_, now_ + begins));
    return *operators.back();
  }
  /// Until nobody has anything to say or to do any more.
  void play() {
    while (!is_quiet()) step();
    // Whoever was left behind by an operator who gave up lets go.
    const MonotonicInstant end = now_ + std::chrono::seconds(65);
    while (now_ < end) step();
  }
  void play_for(Duration duration) {
    const MonotonicInstant end = now_ + duration;
    while (now_ < end) step();
  }
  MonotonicInstant now() const { return now_; }

  bool all_are(Phase phase) const {
    return std::all_of(nodes.begin(), nodes.end(),
                       [&](const auto& node) { return node->phase() == phase; });
  }
  std::vector<std::unique_ptr<SimulatedNode>> nodes;
  std::vector<std::unique_ptr<SimulatedOperator>> operators;
  std::vector<std::string> takes;  ///< for which pulses were made
  bool pulses_only_where_all_record = true;

 private:
  void step() {
    now_ += std::chrono::milliseconds(5);
    world_.network.deliver(now_);
    for (const auto& node : nodes) node->tick(now_);
    for (const auto& person : operators) person->tick(now_);
  }
  bool is_quiet() const {
    return world_.network.empty() && std::all_of(operators.begin(), operators.end(),
                                                 [](const auto& o) { return o->finished(); });
  }
  void note_start(const std::string& take) {
    takes.push_back(take);
    for (const auto& node : nodes) node->see_pulses(now_);
    for (size_t i = 1; i < nodes.size(); ++i) {
      const Phase phase = nodes[i]->phase();
      const bool records = phase == Phase::kRecording || phase == Phase::kLearning;
      if (!records || nodes[i]->take() != take) pulses_only_where_all_record = false;
    }
  }

  World world_;
  CommandTargets studio_;
  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
};

}  // namespace v3d::test
