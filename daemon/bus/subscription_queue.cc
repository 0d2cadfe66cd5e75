#include "daemon/bus/subscription_queue.h"

#include <algorithm>

namespace v3d::bus {
namespace {

/// The longest delay of a message in the network.
constexpr Duration kMaxDelay = std::chrono::seconds(10);

}  // namespace

SequenceCounts& SequenceCounts::operator+=(const SequenceCounts& other) {
  received += other.received;
  lost += other.lost;
  late += other.late;
  duplicate += other.duplicate;
  return *this;
}

void SequenceTracker::note(const std::string& key, int64_t seq, RealtimeInstant sent) {
  if (senders_.size() == kMaxKeys && !senders_.contains(key)) return;
  Sender& sender = senders_.try_emplace(key, Sender{.from_start = from_start_}).first->second;
  const SequenceCounts change = arrived(sender, seq, sent);
  sender.counts += change;
  total_ += change;
}

SequenceCounts SequenceTracker::arrived(Sender& sender, int64_t seq, RealtimeInstant sent) const {
  // A restarted sender may have a clock that was set back meanwhile, so a much older time shows a
  // restart.
  const bool overtaken =
      seq <= sender.newest && sent <= sender.newest_sent && sender.newest_sent - sent < kMaxDelay;
  if (overtaken && sender.missing.erase(seq) > 0) return {.received = 1, .lost = -1, .late = 1};
  if (overtaken) return {.duplicate = 1};
  if (seq <= sender.newest) {  // the sender has restarted
    sender = {.newest = -1, .counts = sender.counts, .from_start = from_start_};
  }
  const bool first = sender.newest < 0 && !sender.from_start;
  const int64_t missed = first ? 0 : std::min(seq - (sender.newest + 1), kMaxMissed);
  const int64_t stored = std::min(missed, kMaxMissingNumbers);
  for (int64_t n = seq - stored; n < seq; ++n) sender.missing.insert(sender.missing.end(), n);
  while (std::ssize(sender.missing) > kMaxMissingNumbers)
    sender.missing.erase(sender.missing.begin());
  sender.newest = seq;
  sender.newest_sent = std::max(sender.newest_sent, sent);
  return {.received = 1, .lost = missed};
}

void SequenceTracker::start_new_count(const std::string& key) {
  if (senders_.size() == kMaxKeys && !senders_.contains(key)) return;
  Sender& sender = senders_[key];
  sender = {.newest = -1, .counts = sender.counts, .from_start = false};
}

SequenceCounts SequenceTracker::of(const std::string& key) const {
  const auto found = senders_.find(key);
  return found == senders_.end() ? SequenceCounts() : found->second.counts;
}

}  // namespace v3d::bus
