#include "daemon/bus/session_replay_filter.h"

#include <algorithm>
#include <utility>

#include "wire/secret_keys.h"

namespace v3d::bus {
namespace {

bool is_young(Duration age) {
  return age <= SessionReplayFilter::kOldest && -age <= SessionReplayFilter::kAhead;
}

/// `sequence` minus `other`, with wrap-around; negative when `sequence` is older.
int64_t distance(uint32_t sequence, uint32_t other) {
  return static_cast<int32_t>(sequence - other);
}

}  // namespace

// --- window -------------------------------------------------------------------------------------

const SessionReplayFilter::Session* SessionReplayFilter::find(uint32_t session,
                                                              const wire::Signer& signer) const {
  const auto found = std::ranges::find_if(
      sessions_, [&](const Session& known) { return known.is_of(session, signer); });
  return found == sessions_.end() ? nullptr : &*found;
}

bool SessionReplayFilter::contains(uint32_t session) const {
  return std::ranges::find(sessions_, session, &Session::id) != sessions_.end();
}

bool SessionReplayFilter::is_received(const SessionStamp& stamp, const wire::Signer& signer) const {
  const Session* const known = find(stamp.session, signer);
  if (known == nullptr) return false;
  const int64_t ahead = distance(stamp.sequence, known->newest);
  if (ahead > 0) return false;
  return -ahead >= kWindow || known->received[stamp.sequence % kWindow];
}

SessionReplayFilter::Session& SessionReplayFilter::find_or_add(const SessionStamp& stamp,
                                                               const ReceiverTime& now,
                                                               const wire::Signer& signer) {
  const auto found = std::ranges::find_if(
      sessions_, [&](const Session& known) { return known.is_of(stamp.session, signer); });
  if (found != sessions_.end()) return *found;
  if (sessions_.size() == kMaxSessions) {
    const auto silent = std::ranges::min_element(sessions_, {}, &Session::received_at);
    floor_ = std::max(floor_, silent->newest_sent);
    sessions_.erase(silent);
    ++forgotten_;
  }
  Session& added = sessions_.emplace_back();
  added.id = stamp.session;
  added.signer = signer;
  added.newest = stamp.sequence;
  added.fast_sent = stamp.sent;
  added.fast_received = now.monotonic;
  return added;
}

void SessionReplayFilter::note(const SessionStamp& stamp, const ReceiverTime& now,
                               const wire::Signer& signer) {
  Session& known = find_or_add(stamp, now, signer);
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

bool SessionReplayFilter::agrees_with_wall_clock(RealtimeInstant sent,
                                                 const ReceiverTime& now) const {
  return sent > floor_ && is_young(now.realtime - sent);
}

bool SessionReplayFilter::is_recent(const SessionStamp& stamp, const ReceiverTime& now,
                                    const wire::Signer& signer) const {
  const Session* const known = find(stamp.session, signer);
  if (known == nullptr) return agrees_with_wall_clock(stamp.sent, now);
  return is_young(known->age(stamp.sent, now.monotonic));
}

bool SessionReplayFilter::is_recent_for_any(const SessionStamp& stamp,
                                            const ReceiverTime& now) const {
  return agrees_with_wall_clock(stamp.sent, now) ||
         std::ranges::any_of(sessions_, [&](const Session& known) {
           return known.id == stamp.session && is_young(known.age(stamp.sent, now.monotonic));
         });
}

Duration SessionReplayFilter::age(const SessionStamp& stamp, const ReceiverTime& now,
                                  const wire::Signer& signer) const {
  const Session* const known = find(stamp.session, signer);
  return known == nullptr ? Duration{}
                          : std::max(Duration{}, known->age(stamp.sent, now.monotonic));
}

MonotonicInstant SessionReplayFilter::sent_here(const SessionStamp& stamp, const ReceiverTime& now,
                                                const wire::Signer& signer) const {
  const Session* const known = find(stamp.session, signer);
  return known == nullptr ? now.monotonic : std::min(now.monotonic, known->sent_here(stamp.sent));
}

bool SessionReplayFilter::has_responded(uint32_t session, const wire::Signer& signer) const {
  const Session* const known = find(session, signer);
  return known != nullptr && known->has_responded;
}

void SessionReplayFilter::accept(const SessionStamp& newest, const ReceiverTime& now,
                                 Duration since_challenge, const wire::Signer& signer) {
  Session& session = find_or_add(newest, now, signer);
  const Duration age = session.age(newest.sent, now.monotonic);
  if (age <= Duration::zero() || age > since_challenge) {
    session.fast_sent = newest.sent;
    session.fast_received = now.monotonic;
  }
  session.newest_sent = newest.sent;
  session.received_at = now.monotonic;
  if (std::exchange(session.has_responded, true)) return;
  if (distance(newest.sequence, session.newest) > 0) session.newest = newest.sequence;
  session.received.set();
}

// --- challenges ----------------------------------------------------------------------------------

std::optional<int64_t> SessionChallenges::issue(uint32_t session, MonotonicInstant now,
                                                const wire::Signer& signer) {
  auto entry = std::ranges::find_if(challenges_, [&](const Challenge& challenge) {
    return challenge.session == session && challenge.signer == signer && challenge.is_pending(now);
  });
  if (entry == challenges_.end()) {
    entry = std::ranges::min_element(challenges_, {}, &Challenge::first_sent);
    *entry = {.session = session,
              .nonce = wire::random_nonce(),
              .signer = signer,
              .first_sent = now,
              .last_sent = {}};
  } else if (now - entry->last_sent < kResendAfter) {
    return std::nullopt;
  }
  entry->last_sent = now;
  return entry->nonce;
}

const SessionChallenges::Challenge* SessionChallenges::find(uint32_t session, int64_t nonce,
                                                            MonotonicInstant now,
                                                            const wire::Signer& signer) const {
  const auto* const entry = std::ranges::find_if(challenges_, [&](const Challenge& challenge) {
    return challenge.session == session && challenge.nonce == nonce && challenge.is_of(signer) &&
           challenge.is_pending(now);
  });
  return entry == challenges_.end() ? nullptr : entry;
}

bool SessionChallenges::is_pending(uint32_t session, int64_t nonce, MonotonicInstant now,
                                   const wire::Signer& signer) const {
  return find(session, nonce, now, signer) != nullptr;
}

std::optional<Duration> SessionChallenges::pop_matching(uint32_t session, int64_t nonce,
                                                        MonotonicInstant now,
                                                        const wire::Signer& signer) {
  const Challenge* const found = find(session, nonce, now, signer);
  if (found == nullptr) return std::nullopt;
  const Duration since_challenge = now - found->first_sent;
  challenges_[static_cast<size_t>(found - challenges_.data())] = {};
  return since_challenge;
}

}  // namespace v3d::bus
