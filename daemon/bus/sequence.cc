#include "daemon/bus/sequence.h"

#include <algorithm>

namespace v3d {
namespace {

/// Networks do not delay a message longer.
constexpr Duration kOvertakenBy = std::chrono::seconds(10);

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
  const SequenceCounts what = arrived(sender, seq, sent);
  sender.counts += what;
  total_ += what;
}

SequenceCounts SequenceTracker::arrived(Sender& sender, int64_t seq, RealtimeInstant sent) const {
  // A sender whose clock was set back while it was away has started again, too.
  const bool overtaken = seq <= sender.newest && sent <= sender.newest_sent &&
                         sender.newest_sent - sent < kOvertakenBy;
  if (overtaken && sender.awaited.erase(seq) > 0) return {.received = 1, .lost = -1, .late = 1};
  if (overtaken) return {.duplicate = 1};
  if (seq <= sender.newest) {  // begins again
    sender = {.newest = -1, .counts = sender.counts, .from_start = from_start_};
  }
  const bool first = sender.newest < 0 && !sender.from_start;
  const int64_t missed = first ? 0 : std::min(seq - (sender.newest + 1), kMaxMissed);
  const int64_t awaited = std::min(missed, kMaxAwaited);
  for (int64_t n = seq - awaited; n < seq; ++n) sender.awaited.insert(sender.awaited.end(), n);
  while (std::ssize(sender.awaited) > kMaxAwaited) sender.awaited.erase(sender.awaited.begin());
  sender.newest = seq;
  sender.newest_sent = std::max(sender.newest_sent, sent);
  return {.received = 1, .lost = missed};
}

void SequenceTracker::listen_anew(const std::string& key) {
  if (senders_.size() == kMaxKeys && !senders_.contains(key)) return;
  Sender& sender = senders_[key];
  sender = {.newest = -1, .counts = sender.counts, .from_start = false};
}

SequenceCounts SequenceTracker::of(const std::string& key) const {
  const auto found = senders_.find(key);
  return found == senders_.end() ? SequenceCounts() : found->second.counts;
}

}  // namespace v3d
