#include "daemon/recond/shard.h"

#include <algorithm>
#include <cmath>

#include "daemon/recond/shard_share.h"
#include "take/take.h"

namespace v3d {
namespace {

/// So far ahead of the stream a pulse is believed: more than what FrameSetAssembler believes.
constexpr int64_t kMaxJump = 20'000;

size_t place_in(const std::vector<std::string>& roster, const std::string& me) {
  return static_cast<size_t>(std::find(roster.begin(), roster.end(), me) - roster.begin());
}

size_t byte_count(const ReadySet& set) {
  size_t bytes = 0;
  for (const Frame& frame : set.set.frames) {
    bytes += frame.image.bytes.size();
    bytes += static_cast<size_t>(frame.sensor_size.pixels()) / 8;  // the mask
  }
  return bytes;
}

}  // namespace

Shard::Shard(const Setup& setup)
    : setup_(setup), me_(place_in(setup.roster, setup.me)), members_(setup.roster, me_) {
  // Nobody has spoken yet.
  heard_ = all_frame_groups(setup.frame_groups);
  if (setup.comes_later) return;
  first_ = 0;
  members_.join(first_);
  order_.emplace(first_);
}

void Shard::turn(MonotonicInstant now) {
  now_ = clock_.turn(now);
  choose_frame_groups();
  if (!order_) return;
  look_through_held();
  put_in_order();
  show();
}

void Shard::join_behind(int64_t pulse) {
  first_ = pulse + 1 + static_cast<int64_t>(std::ceil(setup_.rate_hz * to_seconds(kAhead)));
  members_.join(first_);
  order_.emplace(first_);
}

// --- what is heard ------------------------------------------------------------------------------

void Shard::choose_frame_groups() {
  if (setup_.frame_groups == 1) return;
  const int64_t newest = known_.empty() ? 0 : known_.back().first;
  FrameGroupSet wanted = groups_of(me_, members_.size(), setup_.frame_groups);
  for (size_t place = 0; place < members_.size(); ++place) {
    if (place == me_ || members_.is_there(place, newest, now_)) continue;
    wanted.merge(groups_of(place, members_.size(), setup_.frame_groups));
  }
  for (const size_t group : wanted) {
    if (!heard_.contains(group)) just_joined_.insert(group);
  }
  heard_ = std::move(wanted);
}

/// The first set of a group that was joined in the middle of its frames.
bool Shard::may_be_cut(const ReadySet& set) {
  const size_t group = FrameNumbers::group_of(set.set.pulse, setup_.frame_groups);
  return just_joined_.erase(group) > 0 && !set.missing.empty();
}

// --- what there is ------------------------------------------------------------------------------

void Shard::note_known(int64_t pulse) {
  if (known_.empty() || pulse > known_.back().first) known_.emplace_back(pulse, now_);
}

/// When it was first heard of this pulse, or of a later one.
std::optional<Duration> Shard::known_since(int64_t pulse) const {
  for (const auto& [newest, since] : known_) {
    if (newest >= pulse) return since;
  }
  return std::nullopt;
}

// --- sets ---------------------------------------------------------------------------------------

void Shard::add(ReadySet set) {
  const int64_t pulse = set.set.pulse;
  newest_set_ = std::max(newest_set_, pulse);
  if (!order_ && pulse < kMaxPulses) return join_behind(pulse);
  if (!order_ || pulse < first_) return;
  if (pulse - order_->next() > kMaxJump) return;
  note_known(pulse);
  if (may_be_cut(set)) return;
  if (!order_->has(pulse)) hold(std::move(set));
}

void Shard::hold(ReadySet set) {
  const int64_t pulse = set.set.pulse;
  const size_t bytes = byte_count(set);
  const auto [held, is_new] = held_.emplace(pulse, Held{std::move(set), bytes, std::nullopt});
  if (!is_new) return;
  held_bytes_ += bytes;
  if (is_to_be_made_here(pulse, held->second)) {
    work_on(held->second);
    return let_go(held);
  }
  while (held_.size() > kMaxHeld || held_bytes_ > kMaxHeldBytes) {
    let_go(held_.begin());
    ++counts_.let_go;
  }
}

void Shard::let_go(std::map<int64_t, Held>::iterator held) {
  held_bytes_ -= held->second.bytes;
  held_.erase(held);
}

void Shard::look_through_held() {
  for (auto held = held_.begin(); held != held_.end();) {
    const auto at = held++;
    if (is_given_up(at->first)) {
      let_go(at);
    } else if (is_to_be_made_here(at->first, at->second)) {
      work_on(at->second);
      let_go(at);
    }
  }
}

/// It is this node's; or its node says that it is made, and it does not arrive. Then those who miss
/// it make it one after the other: the first one's is usually enough for all.
bool Shard::is_to_be_made_here(int64_t pulse, Held& held) {
  const size_t maker = members_.maker(pulse, now_);
  if (maker == me_) {
    counts_.taken_over +=
        pulse % static_cast<int64_t>(members_.size()) != static_cast<int64_t>(me_);
    return true;
  }
  if (members_.word(maker).done < pulse) {
    held.promised.reset();
    return false;
  }
  if (!held.promised) held.promised = now_;
  if (now_ - *held.promised < kOnItsWay * (1 + members_.rank(pulse, now_))) return false;
  ++counts_.repeated;
  return true;
}

void Shard::work_on(Held& held) {
  mine_.insert(held.set.set.pulse);
  work_.push_back(std::move(held.set));
}

bool Shard::begin(int64_t pulse) {
  if (!order_->has(pulse)) return true;
  mine_.erase(pulse);
  return false;
}

void Shard::gave_up(int64_t pulse) {
  mine_.erase(pulse);
  // Of another's share nothing is said: that is for its node to say.
  if (members_.maker(pulse, now_) != me_) return;
  members_.give_up(pulse);
  given_up_.push_back(pulse);
  if (given_up_.size() > kMaxGivenUp) given_up_.pop_front();
}

// --- meshes -------------------------------------------------------------------------------------

void Shard::hear(const ShardMessage& word) {
  if (word.take == setup_.take) members_.hear(word, now_);
}

void Shard::hear(MeshMessage mesh) {
  if (!order_ || mesh.take != setup_.take || mesh.pulse < first_) return;
  const int64_t pulse = mesh.pulse;
  if (pulse - order_->next() > kMaxJump) return;
  if (!order_->add(std::move(mesh))) {
    ++counts_.duplicates;
    return;
  }
  note_known(pulse);
  const auto held = held_.find(pulse);
  if (held != held_.end()) let_go(held);
}

void Shard::made(MeshMessage mesh) {
  mine_.erase(mesh.pulse);
  ++counts_.made;
  hear(std::move(mesh));
}

bool Shard::is_given_up(int64_t pulse) const {
  return members_.has_given_up(members_.maker(pulse, now_), pulse);
}

/// Somebody still means to make it.
bool Shard::may_come(int64_t pulse) const {
  if (mine_.contains(pulse) || held_.contains(pulse)) return true;
  const size_t maker = members_.maker(pulse, now_);
  return maker != me_ && members_.word(maker).done < pulse;
}

bool Shard::is_lost(int64_t pulse) const {
  const auto since = known_since(pulse);
  if (!since) return false;
  if (order_->is_full() || now_ - *since >= kLongest) return true;
  return !may_come(pulse) && now_ - *since >= kPatience;
}

void Shard::put_in_order() {
  for (;;) {
    const int64_t pulse = order_->next();
    if (auto mesh = order_->take()) {
      unshown_.push_back({*mesh, now_});
      if (unshown_.size() > kMaxUnshown) unshown_.pop_front();
      ordered_.push_back(*std::move(mesh));
    } else if (is_given_up(pulse)) {
      ++counts_.given_up;
      pass_over(pulse);
    } else if (is_lost(pulse)) {
      ++counts_.lost;
      pass_over(pulse);
    } else {
      break;
    }
  }
  const int64_t next = order_->next();
  members_.forget_before(next);
  while (known_.size() > 1 && known_.front().first < next) known_.pop_front();
}

void Shard::pass_over(int64_t pulse) {
  without_mesh_.insert(pulse);
  order_->pass_over();
  const auto held = held_.find(pulse);
  if (held != held_.end()) let_go(held);
}

// --- the stream that everybody sees -------------------------------------------------------------

void Shard::show() {
  while (!unshown_.empty()) {
    const Unshown& front = unshown_.front();
    const int64_t pulse = front.mesh.pulse;
    const size_t shower = members_.shower(pulse, now_);
    if (shower != me_) shown_ = std::max(shown_, members_.word(shower).shown);
    if (pulse > shown_) {
      if (shower != me_ || !may_begin_to_show(front)) return;
      shows_ = true;
      shown_ = pulse;
      to_show_.push_back(front.mesh);
    }
    unshown_.pop_front();
  }
}

/// A node that came later shows nothing before its predecessor has shown everything before that.
bool Shard::may_begin_to_show(const Unshown& front) const {
  if (shows_ || shown_ >= first_ - 1 || now_ - front.since >= kPatience) return true;
  const size_t before = members_.shower(first_ - 1, now_);
  if (before == me_) return true;
  const ShardMessage& word = members_.word(before);
  return word.ordered >= first_ - 1 && shown_ >= word.shown;
}

// --- what others see ----------------------------------------------------------------------------

ShardMessage Shard::word() const {
  ShardMessage word;
  word.take = setup_.take;
  word.node = setup_.me;
  word.first = first_;
  word.done = mine_.empty() ? newest_set_ : *mine_.begin() - 1;
  word.ordered = order_ ? order_->next() - 1 : -1;
  word.shown = shown_;
  word.given_up.assign(given_up_.begin(), given_up_.end());
  return word;
}

ShardCounts Shard::counts() const {
  ShardCounts counts = counts_;
  counts.living = static_cast<int64_t>(members_.living(now_));
  return counts;
}

bool Shard::is_settled() const {
  if (!order_) return true;
  const bool all_ordered = known_.empty() || order_->next() > known_.back().first;
  return mine_.empty() && held_.empty() && all_ordered && unshown_.empty();
}

}  // namespace v3d
