#include "daemon/recond/shard.h"

#include <algorithm>
#include <cmath>

#include "take/take.h"

namespace v3d::recond {
namespace {

size_t index_in(const std::vector<std::string>& roster, const std::string& node) {
  return static_cast<size_t>(std::find(roster.begin(), roster.end(), node) - roster.begin());
}

size_t byte_count(const recon::ReadySet& set) {
  size_t bytes = 0;
  for (const Frame& frame : set.set.frames) {
    bytes += frame.image.bytes.size();
    bytes += static_cast<size_t>(frame.sensor_size.pixels()) / 8;  // the mask
  }
  return bytes;
}

}  // namespace

Shard::Shard(const Setup& setup, MonotonicInstant now)
    : setup_(setup),
      self_(index_in(setup.roster, setup.node)),
      instant_(now),
      members_(setup.roster, self_, setup.liveness_timeout) {
  // No node is known to be alive yet, so receive the pulses of all.
  groups_ = bus::all_frame_groups(setup.frame_groups);
  if (setup.joins_late) return;
  first_ = 0;
  members_.join(first_);
  reorder_.emplace(first_);
  plausible_.add(first_, now);
}

void Shard::advance(MonotonicInstant now) {
  instant_ = now;
  now_ = clock_.update(now);
  update_frame_groups();
  if (!reorder_) return;
  record_announced();
  check_held_sets();
  order_meshes();
  publish();
}

void Shard::join_after(int64_t pulse) {
  first_ = pulse + 1 + static_cast<int64_t>(std::ceil(setup_.rate_hz * to_seconds(kJoinDelay)));
  members_.join(first_);
  reorder_.emplace(first_);
  plausible_.add(first_, instant_);
}

// --- frame groups -------------------------------------------------------------------------------

void Shard::update_frame_groups() {
  if (setup_.frame_groups == 1) return;
  const int64_t newest = known_.empty() ? 0 : known_.back().first;
  bus::FrameGroupSet wanted = groups_of(self_, members_.size(), setup_.frame_groups);
  for (size_t index = 0; index < members_.size(); ++index) {
    if (index == self_ || members_.is_available(index, newest, now_)) continue;
    wanted.merge(groups_of(index, members_.size(), setup_.frame_groups));
  }
  for (const size_t group : wanted) {
    if (!groups_.contains(group)) new_groups_.insert(group);
  }
  groups_ = std::move(wanted);
}

/// Is this the first set of a group that was joined while its frames were being sent?
bool Shard::may_be_truncated(const recon::ReadySet& set) {
  const size_t group = bus::FrameNumbers::group_of(set.set.pulse, setup_.frame_groups);
  return new_groups_.erase(group) > 0 && !set.missing.empty();
}

// --- known pulses -------------------------------------------------------------------------------

/// False for a pulse that is too far ahead: it would make all further ones late. The first one of a
/// node that joins late may be any pulse of a take.
bool Shard::accept_pulse(int64_t pulse) {
  if (!plausible_.contains(pulse, instant_) || (!reorder_ && pulse >= take::kMaxPulses)) {
    ++counts_.implausible;
    return false;
  }
  plausible_.add(pulse, instant_);
  return true;
}

void Shard::record_known(int64_t pulse) {
  if (known_.empty() || pulse > known_.back().first) known_.emplace_back(pulse, now_);
}

void Shard::on_pulse(int64_t pulse) {
  if (!reorder_ || pulse < reorder_->next() || !plausible_.contains(pulse, instant_)) return;
  if (announced_.empty() || pulse > announced_.back().first) announced_.emplace_back(pulse, now_);
}

/// A pulse of the trigger becomes known when its set had the time to be assembled. Before, no node
/// reports it as pending, and it would count as lost.
void Shard::record_announced() {
  const Duration before = now_ - setup_.deadline - setup_.loss_timeout;
  while (!announced_.empty()) {
    const auto [pulse, since] = announced_.front();
    if (pulse >= reorder_->next()) {
      if (since > before) return;
      record_known(pulse);
    }
    announced_.pop_front();
  }
}

/// When this pulse, or a later one, became known.
std::optional<Duration> Shard::known_since(int64_t pulse) const {
  for (const auto& [newest, since] : known_) {
    if (newest >= pulse) return since;
  }
  return std::nullopt;
}

// --- sets ---------------------------------------------------------------------------------------

void Shard::on_set(recon::ReadySet set) {
  const int64_t pulse = set.set.pulse;
  if (!accept_pulse(pulse)) return;
  newest_set_ = std::max(newest_set_, pulse);
  if (!reorder_) return join_after(pulse);
  if (pulse < first_) return;
  record_known(pulse);
  if (may_be_truncated(set)) return;
  if (!reorder_->has(pulse)) hold(std::move(set));
}

void Shard::hold(recon::ReadySet set) {
  const int64_t pulse = set.set.pulse;
  const size_t bytes = byte_count(set);
  const auto [held, is_new] = held_.emplace(pulse, Held{std::move(set), bytes, std::nullopt});
  if (!is_new) return;
  held_bytes_ += bytes;
  if (should_make(pulse, held->second)) {
    queue_work(held->second);
    return release(held);
  }
  while (held_.size() > kMaxHeld || held_bytes_ > kMaxHeldBytes) {
    release(held_.begin());
    ++counts_.released;
  }
}

void Shard::release(std::map<int64_t, Held>::iterator held) {
  held_bytes_ -= held->second.bytes;
  held_.erase(held);
}

void Shard::check_held_sets() {
  for (auto held = held_.begin(); held != held_.end();) {
    const auto at = held++;
    if (is_given_up(at->first)) {
      release(at);
    } else if (should_make(at->first, at->second)) {
      queue_work(at->second);
      release(at);
    }
  }
}

/// True when this node owns the pulse, or when the owner reports it as made and the mesh does not
/// arrive. Nodes that lack it then wait in turn, by rank: usually the first one's mesh serves all.
bool Shard::should_make(int64_t pulse, Held& held) {
  const size_t owner = members_.owner(pulse, now_);
  if (owner == self_) {
    counts_.taken_over +=
        pulse % static_cast<int64_t>(members_.size()) != static_cast<int64_t>(self_);
    return true;
  }
  if (members_.status(owner).done < pulse) {
    held.reported_done.reset();
    return false;
  }
  if (!held.reported_done) held.reported_done = now_;
  if (now_ - *held.reported_done < setup_.repeat_after * (1 + members_.rank(pulse, now_)))
    return false;
  ++counts_.repeated;
  return true;
}

void Shard::queue_work(Held& held) {
  own_pulses_.insert(held.set.set.pulse);
  work_.push_back(std::move(held.set));
}

bool Shard::begin(int64_t pulse) {
  if (!reorder_->has(pulse)) return true;
  own_pulses_.erase(pulse);
  return false;
}

void Shard::give_up(int64_t pulse) {
  own_pulses_.erase(pulse);
  // Only the owner reports a pulse as given up.
  if (members_.owner(pulse, now_) != self_) return;
  members_.give_up(pulse);
  given_up_.push_back(pulse);
  if (given_up_.size() > kMaxGivenUp) given_up_.pop_front();
}

// --- meshes -------------------------------------------------------------------------------------

void Shard::on_status(const wire::ShardMessage& status) {
  if (status.take == setup_.take) members_.on_status(status, now_);
}

void Shard::on_mesh(wire::MeshMessage mesh) {
  if (!reorder_ || mesh.take != setup_.take || mesh.pulse < first_) return;
  const int64_t pulse = mesh.pulse;
  if (!accept_pulse(pulse)) return;
  if (!reorder_->add(std::move(mesh))) {
    ++counts_.duplicates;
    return;
  }
  record_known(pulse);
  const auto held = held_.find(pulse);
  if (held != held_.end()) release(held);
}

void Shard::on_own_mesh(wire::MeshMessage mesh) {
  own_pulses_.erase(mesh.pulse);
  ++counts_.made;
  on_mesh(std::move(mesh));
}

bool Shard::is_given_up(int64_t pulse) const {
  return members_.has_given_up(members_.owner(pulse, now_), pulse);
}

/// Does a node still report that it will make this mesh?
bool Shard::is_pending(int64_t pulse) const {
  if (own_pulses_.contains(pulse) || held_.contains(pulse)) return true;
  const size_t owner = members_.owner(pulse, now_);
  return owner != self_ && members_.status(owner).done < pulse;
}

bool Shard::is_lost(int64_t pulse) const {
  const auto known = known_since(pulse);
  if (!known) return false;
  if (reorder_->is_full() || now_ - *known >= kMaxWait) return true;
  return !is_pending(pulse) && now_ >= lost_after(pulse, *known);
}

/// The time at which a pulse counts as lost that no node has in work, and that is known since
/// `known`. The mesh of a slow owner may arrive after its status. The node that it belongs to may
/// be silent only for a moment. The set of this node may not be assembled yet.
Duration Shard::lost_after(int64_t pulse, Duration known) const {
  const size_t owner = members_.owner(pulse, now_);
  const auto slot = static_cast<size_t>(pulse % static_cast<int64_t>(members_.size()));
  const Duration done = members_.done_since(owner, pulse).value_or(known);
  const Duration silent = members_.silent_since(slot, now_).value_or(known);
  const bool may_be_assembled = owner == self_ && newest_set_ < pulse;
  return std::max({known, done, silent}) + setup_.loss_timeout +
         (may_be_assembled ? setup_.deadline : Duration::zero());
}

void Shard::order_meshes() {
  for (;;) {
    const int64_t pulse = reorder_->next();
    if (auto mesh = reorder_->pop()) {
      unpublished_.push_back({*mesh, now_});
      if (unpublished_.size() > kMaxUnpublished) unpublished_.pop_front();
      ordered_.push_back(*std::move(mesh));
    } else if (is_given_up(pulse)) {
      ++counts_.given_up;
      skip(pulse);
    } else if (is_lost(pulse)) {
      ++counts_.lost;
      skip(pulse);
    } else {
      break;
    }
  }
  const int64_t next = reorder_->next();
  members_.forget_before(next);
  while (known_.size() > 1 && known_.front().first < next) known_.pop_front();
}

void Shard::skip(int64_t pulse) {
  without_mesh_.insert(pulse);
  reorder_->skip();
  const auto held = held_.find(pulse);
  if (held != held_.end()) release(held);
}

// --- publishing ---------------------------------------------------------------------------------

void Shard::publish() {
  while (!unpublished_.empty()) {
    const Unpublished& front = unpublished_.front();
    const int64_t pulse = front.mesh.pulse;
    const size_t publisher = members_.publisher(pulse, now_);
    if (publisher != self_) published_ = std::max(published_, members_.status(publisher).shown);
    if (pulse > published_) {
      const bool publishes = publisher == self_ && may_start_publishing(front);
      if (!publishes && !is_omitted(front, publisher)) return;
      if (publishes) {
        publishing_ = true;
        published_ = pulse;
        to_publish_.push_back(front.mesh);
      }
    }
    unpublished_.pop_front();
  }
}

/// Has the publisher, another node, skipped this pulse? It has no mesh of it then, and never
/// publishes it.
bool Shard::is_omitted(const Unpublished& front, size_t publisher) const {
  return publisher != self_ && members_.status(publisher).ordered >= front.mesh.pulse &&
         now_ - front.since >= setup_.loss_timeout;
}

/// A node that joined late waits until the previous publisher has published everything before
/// first_, so that no pulse is omitted. The previous one may wait for a mesh up to kMaxWait.
bool Shard::may_start_publishing(const Unpublished& front) const {
  if (publishing_ || published_ >= first_ - 1) return true;
  const size_t before = members_.publisher(first_ - 1, now_);
  if (before == self_) return true;
  const wire::ShardMessage& status = members_.status(before);
  const Duration waited = now_ - front.since;
  if (status.ordered < first_ - 1) {
    return waited >= kMaxWait || unpublished_.size() >= kMaxUnpublished / 2;
  }
  return published_ >= status.shown || waited >= setup_.loss_timeout;
}

// --- status and counts --------------------------------------------------------------------------

wire::ShardMessage Shard::status() const {
  wire::ShardMessage status;
  status.take = setup_.take;
  status.node = setup_.node;
  status.first = first_;
  status.ordered = reorder_ ? reorder_->next() - 1 : -1;
  // A pulse that this node has skipped is done, too: the others need not wait for it.
  status.done =
      own_pulses_.empty() ? std::max(newest_set_, status.ordered) : *own_pulses_.begin() - 1;
  status.shown = published_;
  status.given_up.assign(given_up_.begin(), given_up_.end());
  return status;
}

ShardCounts Shard::counts() const {
  ShardCounts counts = counts_;
  counts.alive = static_cast<int64_t>(members_.alive_count(now_));
  return counts;
}

bool Shard::is_settled() const {
  if (!reorder_) return true;
  const bool all_ordered = known_.empty() || reorder_->next() > known_.back().first;
  const bool all_announced_ordered =
      announced_.empty() || reorder_->next() > announced_.back().first;
  return own_pulses_.empty() && held_.empty() && all_ordered && all_announced_ordered &&
         unpublished_.empty();
}

}  // namespace v3d::recond
