#include "daemon/sequence_window.h"

#include <algorithm>

namespace v3d {
namespace {

/// How far `sequence` is ahead of `other`, or, negative, behind it.
int64_t distance(uint32_t sequence, uint32_t other) {
  return static_cast<int32_t>(sequence - other);
}

}  // namespace

const SequenceWindows::Session* SequenceWindows::find(uint32_t session) const {
  const auto found = std::ranges::find(sessions_, session, &Session::id);
  return found == sessions_.end() ? nullptr : &*found;
}

bool SequenceWindows::is_received(uint32_t session, uint32_t sequence, RealtimeInstant sent) const {
  const Session* const known = find(session);
  if (known == nullptr) return sent <= floor_;
  const int64_t ahead = distance(sequence, known->newest);
  if (ahead > 0) return false;
  return -ahead >= kWindow || known->received[sequence % kWindow];
}

SequenceWindows::Session& SequenceWindows::find_or_add(uint32_t session, uint32_t sequence) {
  const auto found = std::ranges::find(sessions_, session, &Session::id);
  if (found != sessions_.end()) return *found;
  if (sessions_.size() == kMaxSessions) {
    const auto oldest = std::ranges::min_element(sessions_, {}, &Session::sent);
    floor_ = std::max(floor_, oldest->sent);
    sessions_.erase(oldest);
  }
  return sessions_.emplace_back(
      Session{.id = session, .newest = sequence, .sent = RealtimeInstant::min(), .received = {}});
}

void SequenceWindows::note(uint32_t session, uint32_t sequence, RealtimeInstant sent) {
  Session& known = find_or_add(session, sequence);
  const int64_t ahead = distance(sequence, known.newest);
  if (-ahead >= kWindow) return;
  if (ahead >= kWindow) known.received.reset();
  for (int64_t i = 1; i <= ahead && ahead < kWindow; ++i) {
    known.received.reset((known.newest + static_cast<uint32_t>(i)) % kWindow);
  }
  if (ahead > 0) known.newest = sequence;
  known.sent = std::max(known.sent, sent);
  known.received.set(sequence % kWindow);
}

}  // namespace v3d
