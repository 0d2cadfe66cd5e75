#include "daemon/bus/session_replay_filter.h"

#include <algorithm>
#include <utility>

#include "wire/studio_key.h"

namespace v3d {
namespace {

/// `sequence` minus `other`, with wrap-around; negative when `sequence` is older.
int64_t distance(uint32_t sequence, uint32_t other) {
  return static_cast<int32_t>(sequence - other);
}

}  // namespace

// --- window -------------------------------------------------------------------------------------

const SessionReplayFilter::Session* SessionReplayFilter::find(uint32_t session) const {
  const auto found = std::ranges::find(sessions_, session, &Session::id);
  return found == sessions_.end() ? nullptr : &*found;
}

bool SessionReplayFilter::is_received(const SessionStamp& stamp) const {
  const Session* const known = find(stamp.session);
  if (known == nullptr) return false;
  const int64_t ahead = distance(stamp.sequence, known->newest);
  if (ahead > 0) return false;
  return -ahead >= kWindow || known->received[stamp.sequence % kWindow];
}

SessionReplayFilter::Session& SessionReplayFilter::find_or_add(const SessionStamp& stamp,
                                                               const ReceiverTime& now) {
  const auto found = std::ranges::find(sessions_, stamp.session, &Session::id);
  if (found != sessions_.end()) return *found;
  if (sessions_.size() == kMaxSessions) {
    const auto silent = std::ranges::min_element(sessions_, {}, &Session::received_at);
    floor_ = std::max(floor_, silent->newest_sent);
    sessions_.erase(silent);
    ++forgotten_;
  }
  Session& added = sessions_.emplace_back();
  added.id = stamp.session;
  added.newest = stamp.sequence;
  added.fast_sent = stamp.sent;
  added.fast_received = now.monotonic;
  return added;
}

void SessionReplayFilter::note(const SessionStamp& stamp, const ReceiverTime& now) {
  Session& known = find_or_add(stamp, now);
  if (known.delay(stamp.sent, now.monotonic) <= known.drift(now.monotonic)) {
    known.fast_sent = stamp.sent;
    known.fast_received = now.monotonic;
  }
  const int64_t ahead = distance(stamp.sequence, known.newest);
  if (-ahead >= kWindow) return;
  if (ahead >= kWindow) known.received.reset();
  for (int64_t i = 1; i <= ahead && ahead < kWindow; ++i) {
    known.received.reset((known.newest + static_cast<uint32_t>(i)) % kWindow);
  }
  if (ahead > 0) known.newest = stamp.sequence;
  known.newest_sent = std::max(known.newest_sent, stamp.sent);
  known.received_at = now.monotonic;
  known.received.set(stamp.sequence % kWindow);
}

// --- recency ------------------------------------------------------------------------------------

bool SessionReplayFilter::is_recent(const SessionStamp& stamp, const ReceiverTime& now) const {
  const Session* const known = find(stamp.session);
  const Duration age = known == nullptr
                           ? now.realtime - stamp.sent
                           : known->delay(stamp.sent, now.monotonic) - known->drift(now.monotonic);
  if (known == nullptr && stamp.sent <= floor_) return false;
  return age <= kOldest && -age <= kAhead;
}

bool SessionReplayFilter::has_answered(uint32_t session, const Signer& signer) const {
  const Session* const known = find(session);
  return known != nullptr && known->has_answered && known->answered_by == signer;
}

bool SessionReplayFilter::is_answered_by_other(uint32_t session, const Signer& signer) const {
  const Session* const known = find(session);
  return known != nullptr && known->has_answered && known->answered_by != signer;
}

void SessionReplayFilter::accept(const SessionStamp& newest, const ReceiverTime& now,
                                 const Signer& signer) {
  Session& session = find_or_add(newest, now);
  session.fast_sent = newest.sent;
  session.fast_received = now.monotonic;
  session.newest_sent = newest.sent;
  session.received_at = now.monotonic;
  const bool is_first = !session.has_answered || session.answered_by != signer;
  session.has_answered = true;
  session.answered_by = signer;
  if (!is_first) return;
  if (distance(newest.sequence, session.newest) > 0) session.newest = newest.sequence;
  session.received.set();
}

// --- questions ----------------------------------------------------------------------------------

std::optional<int64_t> SessionQuestions::ask(uint32_t session, MonotonicInstant now,
                                             const Signer& signer) {
  auto entry = std::ranges::find_if(questions_, [&](const Question& question) {
    return question.session == session && question.signer == signer && question.is_pending(now);
  });
  if (entry == questions_.end()) {
    entry = std::ranges::min_element(questions_, {}, &Question::first_asked);
    *entry = {.session = session,
              .nonce = random_nonce(),
              .signer = signer,
              .first_asked = now,
              .last_asked = {}};
  } else if (now - entry->last_asked < kAgainAfter) {
    return std::nullopt;
  }
  entry->last_asked = now;
  return entry->nonce;
}

const SessionQuestions::Question* SessionQuestions::find(uint32_t session, int64_t nonce,
                                                         MonotonicInstant now,
                                                         const Signer& signer) const {
  const auto* const entry = std::ranges::find_if(questions_, [&](const Question& question) {
    return question.session == session && question.nonce == nonce && question.is_of(signer) &&
           question.is_pending(now);
  });
  return entry == questions_.end() ? nullptr : entry;
}

bool SessionQuestions::is_pending(uint32_t session, int64_t nonce, MonotonicInstant now,
                                  const Signer& signer) const {
  return find(session, nonce, now, signer) != nullptr;
}

bool SessionQuestions::answers(uint32_t session, int64_t nonce, MonotonicInstant now,
                               const Signer& signer) {
  const Question* const found = find(session, nonce, now, signer);
  if (found == nullptr) return false;
  questions_[static_cast<size_t>(found - questions_.data())] = {};
  return true;
}

}  // namespace v3d
