#include "simulation/truth.h"

#include <algorithm>

#include "v3dctl/operate/reply_text.h"

namespace v3d::simulation {
namespace {

bool expects_pulses(control::Phase phase) {
  return phase == control::Phase::kRecording || phase == control::Phase::kLearning;
}

}  // namespace

void Truth::on_change(const Change& change) {
  Node& node = nodes_[change.node];
  const std::string id = order_id(change.order);
  if (change.cause == Cause::kTakeBack) check_take_back(change, node);
  if (expects_pulses(change.from) && !expects_pulses(change.to)) node.left[node.id] = change.cause;
  const bool leaves = change.to == control::Phase::kIdle || change.to == control::Phase::kFault;
  if (leaves && change.node == studio_.commanded.trigger) ended_[change.order.sender] = ++events_;
  node.phase = change.to;
  node.id = change.to == control::Phase::kIdle || change.to == control::Phase::kFault ? "" : id;
  if (change.to == control::Phase::kArmed) node.committed.insert(id);
  if (!expects_pulses(change.to)) return;
  node.started.insert(id);
  node.left.erase(id);
  if (change.command.verb == wire::CommandVerb::kStart) node.started_by = change.command.sender;
}

/// A sender may take back only what it began itself. Exception: a failed start also ends a take
/// that another sender armed.
void Truth::check_take_back(const Change& change, const Node& node) {
  const std::string& sender = change.command.sender;
  const bool armed =
      change.from == control::Phase::kArmed && verbs_[sender] == wire::CommandVerb::kStart;
  const std::string& owner = expects_pulses(change.from) ? node.started_by : change.order.sender;
  const bool is_over =
      change.from == control::Phase::kDraining || change.from == control::Phase::kFault;
  const bool is_left = nodes_[studio_.commanded.trigger].id != order_id(change.order);
  if (armed || sender == owner || is_over || is_left) return;
  violate(change.node + ": " + sender + " takes back an order of " + owner);
}

/// A take that ended before its first pulse is quarantined, and its name may be used again.
bool Truth::has_pulses(const std::string& take) const {
  const auto known = by_take_.find(take);
  return known != by_take_.end() && trains_.at(known->second).pulses > 0;
}

void Truth::on_train(const wire::CommandMessage& order) {
  const std::string id = order_id(order);
  running_ = id;
  const bool is_known = trains_.contains(id);
  trains_[id] = {.take = order.take, .verb = order.verb};
  if (order.verb == wire::CommandVerb::kArm) {
    if (is_known || has_pulses(order.take)) violate(order.take + " has two trains");
    by_take_[order.take] = id;
  }
  for (const std::string& name : studio_.commanded.nodes) {
    if (name == studio_.commanded.trigger) continue;
    if (!nodes_[name].started.contains(id)) {
      violate("pulses of " + order.take + " run, but " + name + " never recorded it");
    }
  }
}

void Truth::on_pulse(int64_t pulse, bool sensed) {
  Train& train = trains_[running_];
  if (pulse != train.pulses) violate(train.take + ": pulse numbers have a gap");
  ++train.pulses;
  train.sensed += sensed ? 1 : 0;
  if (train.verb == wire::CommandVerb::kBackground)
    return;  // learning may end before the last pulse
  for (const std::string& name : studio_.commanded.nodes) {
    if (name != studio_.commanded.trigger) check_recording(name, nodes_[name], running_);
  }
}

/// While pulses run, a node must record, unless it ended, a disk is full, or an operator stopped
/// it.
void Truth::check_recording(const std::string& name, const Node& node, const std::string& id) {
  if (node.phase == control::Phase::kRecording && node.id == id) return;
  const auto left = node.left.find(id);
  const Cause cause = left == node.left.end() ? Cause::kOtherCommand : left->second;
  if (cause == Cause::kEnded || cause == Cause::kDisk || cause == Cause::kStopOrAbort) return;
  violate("pulses of " + trains_[id].take + " run, but " + name + " does not record it: " +
          (cause == Cause::kTakeBack ? "a failed start was taken back there"
           : cause == Cause::kReport ? "it decided that the train had ended"
                                     : "no reason is known"));
}

void Truth::on_frame_written(const std::string& node, const std::string& take,
                             const std::string& id, const std::string& camera, int64_t pulse) {
  if (id != running_) {
    violate(node + " writes a frame of " + trains_[running_].take + " into " + take);
  }
  if (!nodes_[node].written[take][camera].insert(pulse).second) {
    violate(node + " has two frames of one pulse");
  }
}

void Truth::on_removed(const std::string& node, const std::string& take, const TakeOnDisk& disk) {
  if (disk.has_frames_or_pulses())
    violate(node + " removes " + take + ", which has frames or pulses");
}

bool Truth::has_frame(const std::string& take, const std::string& camera, int64_t pulse) const {
  for (const auto& [name, node] : nodes_) {
    const auto written = node.written.find(take);
    if (written == node.written.end()) continue;
    const auto frames = written->second.find(camera);
    if (frames != written->second.end() && frames->second.contains(pulse)) return true;
  }
  return false;
}

// --- answers ------------------------------------------------------------------------------------

/// Whether pulses of the take that the trigger's node states were ever made.
bool Truth::has_train(const control::Answer& answer) const {
  const std::string& take = answer.replies.at(studio_.commanded.trigger).take;
  return std::ranges::any_of(trains_, [&](const auto& entry) { return entry.second.take == take; });
}

void Truth::on_answer(const wire::CommandMessage& order, const std::string& sender, int64_t counter,
                      const control::Answer& answer) {
  if (order.verb == wire::CommandVerb::kStop) return check_stop(answer);
  if (!answer.done()) return;
  if (order.verb == wire::CommandVerb::kStart && !has_train(answer)) {
    violate("a start was answered 'done', but no pulse was made");
  }
  if (order.verb != wire::CommandVerb::kArm && order.verb != wire::CommandVerb::kCheck) return;
  check_only_winner(order, sender);
  wire::CommandMessage armed = order;
  armed.sender = sender;
  armed.counter = counter;
  for (const std::string& name : studio_.commanded.nodes) {
    if (nodes_[name].committed.contains(order_id(armed))) continue;
    violate("arm " + order.take + " was answered 'done', but " + name + " was never armed for it");
  }
}

/// Two operators never both win: when two orders to arm overlap in time and both are answered
/// "done", the trigger's node has left the first one before the second one was answered.
void Truth::check_only_winner(const wire::CommandMessage& order, const std::string& sender) {
  if (winner_ && begun_[sender] < winner_->answered && !ended_.contains(winner_->sender)) {
    violate("arm " + order.take + " and arm " + winner_->take + " overlap, and both are done");
  }
  winner_ = Winner{.sender = sender, .take = order.take, .answered = ++events_};
}

void Truth::check_stop(const control::Answer& answer) {
  std::vector<std::string> cameras;
  for (const auto& [node, names] : studio_.cameras) {
    cameras.insert(cameras.end(), names.begin(), names.end());
  }
  ctl::TakeAccount account = ctl::merge_ledgers(answer);
  if (!account.unreadable.empty()) violate("a ledger is not readable");
  if (account.ledger.take.empty()) return;
  const bool from_all = answer.done() && account.of_another_take.empty();
  if (!from_all) account = ctl::merge_ledgers(answer, cameras);
  const take::Ledger& ledger = account.ledger;
  check_complete(ledger);
  const auto id = by_take_.find(ledger.take);
  if (id == by_take_.end() || !from_all) return;
  const Train& train = trains_[id->second];
  if (ledger.commanded > train.pulses)
    violate("the account of " + ledger.take + " has too many pulses");
  if (ledger.commanded < train.pulses && !train.trigger_lost) {
    violate("the account of " + ledger.take + " lacks pulses without a reported reason");
  }
  check_cameras("the account", ledger);
}

/// Checks that a ledger that reports "complete" has every frame of every camera.
void Truth::check_complete(const take::Ledger& ledger) {
  if (!ledger.complete()) return;
  const int64_t pulses = pulses_of(ledger.take);
  if (ledger.commanded != pulses)
    violate(ledger.take + " is reported as complete, but lacks pulses");
  for (const auto& [node, cameras] : studio_.cameras) {
    for (const std::string& camera : cameras) {
      for (int64_t pulse = 0; pulse < pulses; ++pulse) {
        if (!has_frame(ledger.take, camera, pulse)) {
          violate(ledger.take + " is reported as complete, but " + camera + " lacks a frame");
        }
      }
    }
  }
}

/// Checks that the ledger lists exactly the pulses without a frame as missing.
void Truth::check_cameras(const std::string& where, const take::Ledger& ledger) {
  for (const take::CameraLedger& camera : ledger.cameras) {
    const std::set<int64_t> missing(camera.missing.begin(), camera.missing.end());
    for (const int64_t pulse : missing) {
      if (!has_frame(ledger.take, camera.name, pulse)) continue;
      violate(where + " of " + ledger.take + " reports that " + camera.name + " misses pulse " +
              std::to_string(pulse) + ", whose frame is on the disk");
    }
    for (int64_t pulse = 0; pulse < ledger.commanded; ++pulse) {
      if (missing.contains(pulse) || has_frame(ledger.take, camera.name, pulse)) continue;
      violate(where + " of " + ledger.take + " does not report that " + camera.name +
              " misses pulse " + std::to_string(pulse));
    }
  }
}

// --- disks --------------------------------------------------------------------------------------

void Truth::check_disk(const std::string& node, const NodeDisk& disk) {
  for (const std::string& take : disk.open_takes()) {
    if (studio_.cameras.contains(node)) violate(node + " has left " + take + " open");
  }
  for (const auto& [take, cameras] : nodes_[node].written) {
    for (const auto& [camera, pulses] : cameras) {
      const auto kept = disk.takes.find(take);
      const bool is_there = kept != disk.takes.end() && kept->second.frames.contains(camera) &&
                            kept->second.frames.at(camera).size() == pulses.size();
      if (!is_there) violate(node + " has lost frames of " + take);
      if (is_there && !kept->second.ledger) violate(node + " has no ledger of " + take);
      if (is_there && kept->second.ledger) check_cameras(node + "'s ledger", *kept->second.ledger);
    }
  }
}

bool Truth::check_joined(const std::string& take, const std::map<std::string, take::Ledger>& parts,
                         bool has_triggers) {
  std::vector<take::Ledger> ledgers;
  for (const auto& [node, ledger] : parts) ledgers.push_back(ledger);
  const take::Ledger joined = merge(ledgers);
  const Train& train = trains_[by_take_[take]];
  const bool is_joined = std::ranges::all_of(
      studio_.cameras, [&](const auto& node) { return parts.contains(node.first); });
  if (is_joined) check_complete(joined);
  check_cameras("the joined ledger", joined);
  if (joined.commanded > train.pulses)
    violate("the joined ledger of " + take + " has too many pulses");
  if (has_triggers && !train.trigger_lost && joined.commanded < train.pulses) {
    violate("the joined ledger of " + take + " lacks pulses");
  }
  return is_joined && joined.complete();
}

std::vector<std::string> Truth::takes() const {
  std::vector<std::string> takes;
  for (const auto& [take, id] : by_take_) {
    if (trains_.at(id).pulses > 0) takes.push_back(take);
  }
  return takes;
}

int64_t Truth::pulses_of(const std::string& take) const {
  const auto id = by_take_.find(take);
  return id == by_take_.end() ? 0 : trains_.at(id->second).pulses;
}

}  // namespace v3d::simulation
