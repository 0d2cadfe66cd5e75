#include "simulation/schedule.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "simulation/network.h"
#include "simulation/node_process.h"
#include "simulation/operator_process.h"
#include "simulation/trace.h"
#include "simulation/trigger.h"
#include "simulation/truth.h"

namespace v3d::simulation {
namespace {

using std::chrono::seconds;

/// Limit for all unattended activity after the faults: a prepared node gives up after 60 s, orders
/// last at most 60 s, and a take drains for at most 15 s.
constexpr Duration kSettlesWithin = seconds(100);
/// Limit for a stop and an abort of an operator to make every node idle.
constexpr Duration kIdleWithin = seconds(30);

wire::CommandMessage order_of(wire::CommandVerb verb, const std::string& take = "",
                              int64_t pulses = 0) {
  wire::CommandMessage order;
  order.verb = verb;
  order.take = take;
  order.pulses = pulses;
  return order;
}

/// The timeouts of v3dctl.
Duration timeout_of(wire::CommandVerb verb) {
  if (verb == wire::CommandVerb::kArm) return seconds(30);
  return verb == wire::CommandVerb::kStart || verb == wire::CommandVerb::kAbort ? seconds(10)
                                                                                : seconds(60);
}

OperatorStep step(wire::CommandMessage order, Duration then = {}) {
  const Duration timeout = timeout_of(order.verb);
  return {.order = std::move(order), .timeout = timeout, .then = then};
}

class Schedule {
 public:
  Schedule(uint64_t seed, bool with_trace)
      : draws_(seed),
        trace_(time_, with_trace),
        network_(time_, draws_),
        trigger_(
            time_, draws_, [this](const wire::CommandMessage& order) { on_train(order); },
            [this] { events_.on_pulses_end(); },
            [this](int64_t pulse, bool sensed) { on_pulse(pulse, sensed); }),
        truth_(draw_studio()),
        world_{time_, draws_, network_, truth_, events_, key()} {}

  Outcome play();

 private:
  /// One key for all schedules. It comes from the kernel's random numbers; results do not depend on
  /// it.
  static const wire::StudioKey& key() {
    static const wire::StudioKey key = wire::StudioKey::make();
    return key;
  }

  // --- random choices
  Truth::Studio draw_studio();
  void make_nodes();
  void make_operators();
  std::deque<OperatorStep> draw_steps(int person);
  void draw_faults();
  void draw_fault(Duration at);
  std::vector<size_t> draw_part();
  NodeProcess& any_node() {
    return *nodes_[static_cast<size_t>(draws_.integer(0, static_cast<int>(nodes_.size()) - 1))];
  }

  // --- execution
  void on_train(const wire::CommandMessage& order) {
    truth_.on_train(order);
    events_.on_pulses_begin(order);
  }
  void on_pulse(int64_t pulse, bool sensed);
  void deliver_frame(NodeProcess& node, const std::string& camera, int64_t pulse);
  void heal();
  bool is_broken() const { return !truth_.violation().empty(); }
  bool run_until(Duration within, const std::function<bool()>& done);
  bool is_settled() const;
  bool is_idle() const;
  void settle();
  void make_idle();
  void record_final_take();
  void check_disks();
  Outcome outcome();

  VirtualTime time_;
  Draws draws_;
  Trace trace_;
  Network network_;
  Trigger trigger_;
  control::CommandTargets commanded_;
  std::map<std::string, std::vector<std::string>> cameras_;
  bool steps_clocks_ = false;
  Truth truth_;
  ProtocolEvents events_;
  World world_;
  std::vector<std::unique_ptr<NodeProcess>> nodes_;
  std::vector<std::unique_ptr<OperatorProcess>> operators_;
  Duration faults_end_{};
  Outcome outcome_;
};

// --- random choices -----------------------------------------------------------------------------

Truth::Studio Schedule::draw_studio() {
  const int captures = draws_.integer(1, 5);
  const int recons = draws_.integer(0, 3);
  // The trigger's node has cameras or none.
  const bool trigger_has_cameras = captures == 1 || draws_.chance(0.7);
  for (int i = 1; i <= captures; ++i) {
    const std::string name = "cap" + std::to_string(i);
    commanded_.nodes.push_back(name);
    const int count = i == 1 && !trigger_has_cameras ? 0 : draws_.integer(1, 2);
    for (int c = 1; c <= count; ++c) cameras_[name].push_back(name + "cam" + std::to_string(c));
  }
  for (int i = 1; i <= recons; ++i) commanded_.nodes.push_back("recon" + std::to_string(i));
  commanded_.trigger = "cap1";
  steps_clocks_ = draws_.chance(0.3);
  return {.commanded = commanded_, .cameras = cameras_};
}

void Schedule::make_nodes() {
  world_.has_sense_line = draws_.chance(0.7);
  world_.rate_hz = draws_.integer(2, 12);
  trigger_.set_unsensed(world_.has_sense_line && draws_.chance(0.1) ? 0.05 : 0);
  const double frame_loss = draws_.chance(0.3) ? 0.03 : 0;
  for (const std::string& name : commanded_.nodes) {
    events_.add_node(name);
    const bool is_trigger = name == commanded_.trigger;
    Host host{.name = name,
              .captures = name.starts_with("cap"),
              .cameras = cameras_.contains(name) ? cameras_.at(name) : std::vector<std::string>(),
              .trigger = is_trigger ? &trigger_ : nullptr,
              .disk = {},
              .frame_loss = frame_loss,
              .clock_error = draws_.seconds(-0.4, 0.4)};
    nodes_.push_back(std::make_unique<NodeProcess>(world_, trace_, std::move(host), is_trigger));
    nodes_.back()->listen_to_trigger_at(nodes_.front()->place());
    time_.after(draws_.seconds(0, 2), [node = nodes_.back().get()] { node->boot(); });
  }
}

std::deque<OperatorStep> Schedule::draw_steps(int person) {
  std::deque<OperatorStep> steps;
  const int takes = draws_.integer(1, 3);
  for (int i = 0; i < takes; ++i) {
    const bool is_known = draws_.chance(0.05);
    const std::string take =
        is_known ? "kendo-0-0" : "kendo-" + std::to_string(person) + "-" + std::to_string(i);
    const int64_t pulses = draws_.chance(0.25) ? draws_.integer(3, 40) : 0;
    const int kind = draws_.integer(0, 19);
    if (kind == 0) {
      steps.push_back(step(order_of(wire::CommandVerb::kBackground, "", draws_.integer(2, 12))));
      continue;
    }
    if (kind == 1) steps.push_back(step(order_of(wire::CommandVerb::kCheck, "check", 10)));
    if (kind > 1) steps.push_back(step(order_of(wire::CommandVerb::kArm, take, pulses)));
    steps.back().then = draws_.seconds(0, 2);
    if (kind == 2) continue;
    if (kind > 3)
      steps.push_back(step(order_of(wire::CommandVerb::kStart), draws_.seconds(0.2, 8)));
    const bool names_it = draws_.chance(0.3);
    const wire::CommandVerb verb =
        draws_.chance(0.8) ? wire::CommandVerb::kStop : wire::CommandVerb::kAbort;
    steps.push_back(step(order_of(verb, names_it && kind > 1 ? take : ""), draws_.seconds(0, 3)));
  }
  return steps;
}

void Schedule::make_operators() {
  const int people = draws_.integer(1, 3);
  for (int i = 0; i < people; ++i) {
    operators_.push_back(std::make_unique<OperatorProcess>(
        world_, trace_, "person" + std::to_string(i), commanded_));
    time_.after(
        draws_.seconds(0, i == 0 ? 3 : 12),
        [person = operators_.back().get(), steps = draw_steps(i)] { person->begin(steps); });
  }
}

void Schedule::draw_faults() {
  const double badness = draws_.chance(0.5) ? draws_.between(0, 1) : 0;
  network_.set_faults({.loss = 0.3 * badness,
                       .repeat = 0.3 * draws_.between(0, badness),
                       .late = 0.1 * draws_.between(0, badness),
                       .latest = draws_.seconds(0.1, 6)});
  faults_end_ = draws_.seconds(12, 30);
  outcome_.faults = draws_.chance(0.15) ? 0 : draws_.integer(1, 6);
  for (int i = 0; i < outcome_.faults; ++i) {
    draw_fault(draws_.seconds(2, to_seconds(faults_end_) - 1));
  }
}

/// Hosts on one side of a partitioned network: a single one or several.
std::vector<size_t> Schedule::draw_part() {
  std::vector<size_t> all;
  for (const auto& host : nodes_) all.push_back(host->place());
  for (const auto& person : operators_) all.push_back(person->place());
  if (draws_.chance(0.3)) return {nodes_.front()->place()};
  if (draws_.chance(0.3))
    return {all[static_cast<size_t>(draws_.integer(0, static_cast<int>(all.size()) - 1))]};
  std::vector<size_t> part;
  for (const size_t place : all) {
    if (draws_.chance(0.4)) part.push_back(place);
  }
  return part;
}

void Schedule::draw_fault(Duration at) {
  NodeProcess* const node = &any_node();
  const Duration lasts = draws_.seconds(0.05, draws_.chance(0.5) ? 1.5 : 8);
  const auto begin_and_end = [&](const std::function<void()>& begin,
                                 const std::function<void()>& end) {
    time_.after(at, begin);
    time_.after(std::min(at + lasts, faults_end_), end);
  };
  const auto reboot = [node] { node->boot(); };
  switch (draws_.integer(0, steps_clocks_ ? 9 : 7)) {
    case 0:
    case 1:
      return begin_and_end([node] { node->crash(); }, reboot);
    case 2:
      return begin_and_end([node] { node->ask_to_end(); }, reboot);
    case 3:
      return begin_and_end([node] { node->pause(); }, [node] { node->resume(); });
    case 4: {
      const std::vector<size_t> places = draw_part();
      return begin_and_end(
          [this, places] {
            trace_.add([] { return std::string("the network is partitioned"); });
            for (const size_t place : places) network_.put_into_part(place, 1);
          },
          [this] {
            trace_.add([] { return std::string("the network is whole again"); });
            network_.join_parts();
          });
    }
    case 5:
      time_.after(at, [this, node] {
        trace_.add([&] { return "the disk of " + node->host().name + " is full"; });
        node->host().disk.is_full = true;
      });
      return;
    case 6:
      time_.after(at, [person = operators_[static_cast<size_t>(draws_.integer(
                                               0, static_cast<int>(operators_.size()) - 1))]
                                    .get()] { person->kill(); });
      return;
    case 7:
      outcome_.loses_ledgers = true;
      time_.after(at, [this, node] {
        trace_.add([&] { return "the disk of " + node->host().name + " takes no ledger"; });
        node->host().disk.loses_ledgers = true;
      });
      return;
    default: {
      const double size = draws_.chance(0.5) ? draws_.between(1, 10) : draws_.between(10, 3600);
      const Duration by = from_seconds(draws_.chance(0.5) ? size : -size);
      time_.after(at, [this, node, by] {
        trace_.add([&] {
          return "the clock of " + node->host().name + " steps by " +
                 std::to_string(to_seconds(by)) + " s";
        });
        node->host().clock_error += by;
      });
    }
  }
}

// --- execution ----------------------------------------------------------------------------------

void Schedule::on_pulse(int64_t pulse, bool sensed) {
  ++outcome_.pulses;
  truth_.on_pulse(pulse, sensed);
  for (const auto& node : nodes_) {
    if (!node->is_up()) continue;
    if (node->is_trigger() && world_.has_sense_line && sensed) node->on_sensed(pulse);
    if (!node->host().captures) deliver_frame(*node, "", pulse);
    for (const std::string& camera : node->host().cameras) deliver_frame(*node, camera, pulse);
  }
}

void Schedule::deliver_frame(NodeProcess& node, const std::string& camera, int64_t pulse) {
  if (draws_.chance(node.host().frame_loss)) return;
  time_.after(draws_.seconds(0.005, 0.04), [&node, camera, pulse, work = node.work()] {
    if (node.is_up() && node.work() == work) node.on_frame(camera, pulse);
  });
}

bool Schedule::run_until(Duration within, const std::function<bool()>& done) {
  return time_.run_until(time_.now() + within, [&] { return is_broken() || done(); });
}

void Schedule::heal() {
  trace_.add([] { return std::string("the faults end"); });
  network_.set_faults({});
  network_.join_parts();
  for (const auto& node : nodes_) {
    node->host().disk.is_full = node->host().disk.loses_ledgers = false;
    node->host().frame_loss = 0;
    node->host().not_ready = 0;
    trigger_.set_unsensed(0);
    node->resume();
    node->boot();
  }
}

/// True when every remaining activity waits for an operator: a take that is armed or that runs.
bool Schedule::is_settled() const {
  const control::Phase trigger = nodes_.front()->phase();
  const bool waits = trigger == control::Phase::kArmed || trigger == control::Phase::kRecording;
  const bool nodes_settled = std::ranges::all_of(nodes_, [&](const auto& node) {
    const control::Phase phase = node->phase();
    if (phase == control::Phase::kRecording) return waits && node->id() == nodes_.front()->id();
    return phase == control::Phase::kIdle || phase == control::Phase::kFault ||
           phase == control::Phase::kArmed;
  });
  return nodes_settled &&
         std::ranges::none_of(operators_, [](const auto& o) { return o->is_busy(); });
}

bool Schedule::is_idle() const {
  return std::ranges::all_of(
      nodes_, [](const auto& node) { return node->phase() == control::Phase::kIdle; });
}

/// Waits until the studio is settled. A node that was still shutting down is started again.
void Schedule::settle() {
  const MonotonicInstant began = time_.now();
  const auto all_up = [&] {
    for (const auto& node : nodes_) node->boot();
    return is_settled();
  };
  const bool settled = run_until(kSettlesWithin, all_up);
  outcome_.settled_s = to_seconds(time_.now() - began);
  if (settled || is_broken()) return;
  truth_.violate("the studio is not settled 100 s after the faults");
}

void Schedule::make_idle() {
  const MonotonicInstant began = time_.now();
  OperatorProcess& person = *operators_.front();
  person.begin(
      {step(order_of(wire::CommandVerb::kStop)), step(order_of(wire::CommandVerb::kAbort))});
  run_until(kIdleWithin, [&] { return !person.is_busy() && is_idle(); });
  outcome_.idle_s = to_seconds(time_.now() - began);
  if (is_broken() || is_idle()) return;
  truth_.violate("a stop and an abort do not make every node idle");
}

/// Checks that a take after the faults succeeds and is complete.
void Schedule::record_final_take() {
  OperatorProcess& person = *operators_.front();
  person.begin({step(order_of(wire::CommandVerb::kArm, "last")),
                step(order_of(wire::CommandVerb::kStart), seconds(1)),
                step(order_of(wire::CommandVerb::kStop))});
  run_until(seconds(130), [&] { return !person.is_busy(); });
  if (is_broken()) return;
  if (!person.was_done()) return truth_.violate("no take succeeds after the faults");
  // Every node must know every pulse, for all clock errors.
  std::vector<take::Ledger> parts;
  for (const auto& node : nodes_) {
    const auto kept = node->host().disk.takes.find("last");
    if (kept == node->host().disk.takes.end() || !kept->second.ledger) continue;
    parts.push_back(*kept->second.ledger);
  }
  if (!merge(parts).complete()) truth_.violate("the take after the faults is not complete");
}

void Schedule::check_disks() {
  for (const auto& node : nodes_) {
    if (node->host().disk.open_takes().empty()) continue;
    node->crash();  // its restart recovers the takes
    node->boot();
  }
  run_until(seconds(5), [] { return false; });
  for (const auto& node : nodes_) truth_.check_disk(node->host().name, node->host().disk);
  for (const std::string& take : truth_.takes()) {
    std::map<std::string, take::Ledger> parts;
    bool has_triggers = false;
    for (const auto& node : nodes_) {
      const auto kept = node->host().disk.takes.find(take);
      if (kept == node->host().disk.takes.end() || !kept->second.ledger) continue;
      parts.emplace(node->host().name, *kept->second.ledger);
      has_triggers = has_triggers || node->is_trigger();
    }
    ++outcome_.takes;
    outcome_.complete += truth_.check_joined(take, parts, has_triggers) ? 1 : 0;
  }
}

Outcome Schedule::outcome() {
  outcome_.violation = truth_.violation();
  outcome_.trace = trace_.lines();
  outcome_.events = events_.trace();
  return std::move(outcome_);
}

Outcome Schedule::play() {
  make_nodes();
  make_operators();
  draw_faults();
  run_until(faults_end_, [] { return false; });
  if (!is_broken()) heal();
  if (!is_broken()) settle();
  if (!is_broken()) make_idle();
  if (!is_broken()) record_final_take();
  if (!is_broken()) check_disks();
  return outcome();
}

}  // namespace

Outcome play_schedule(uint64_t seed, bool with_trace) { return Schedule(seed, with_trace).play(); }

}  // namespace v3d::simulation
