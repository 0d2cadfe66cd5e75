/* Spin model of sessions: which health and pulses a receiver accepts (docs/security.md, "Clocks";
 * daemon/bus/session_replay_filter.h, daemon/bus/message_receiver.cc).
 *
 * A sender sends health and data (frames, events) in two sessions: its process restarts once. Its clock is set once,
 * forwards or backwards. The receiver restarts once, and its wall clock is set once. An adversary delivers any earlier
 * message at any time, any number of times, and delays challenges and responses. The receiver remembers kMaxSessions
 * sessions. A tick is 5 s (SessionReplayFilter::kOldest). Checked in every state:
 *   - no health is accepted twice, for all restarts and clock settings;
 *   - after its restart the receiver accepts no health of a session that had ended before;
 *   - without a step of the sender's clock, no health is accepted that is older than kOldest and the time of a response;
 *   - the health of a live sender is accepted repeatedly (LTL, weak fairness).
 *
 * Macros switch on faults, to show that the model finds them: ACCEPT_BY_CLOCK (an unknown session whose time
 * agrees with the wall clock needs no response), KEEP_OLDER_AT_RESPONSE (the first response of a known session leaves
 * older messages acceptable), RESPONSE_WITHOUT_NONCE (old responses are accepted), RESPONSE_OF_FORGOTTEN_SESSION (a
 * challenge remains pending when its session is forgotten), NO_CHALLENGES (unknown sessions are not challenged). */

#define kSessions 2
#ifndef kMessages
#define kMessages 2
#endif
#ifndef kData
#define kData 2       /* the messages that are data, as bits */
#endif
#define kEnd 2        /* ticks */
#define kOldest 1
#define kZero 2       /* the clocks show kZero + ticks, so that they can be set back */
#ifndef kMaxSessions
#define kMaxSessions 2
#endif

byte t;                       /* true time */
byte ahead = kZero;           /* the sender's clock shows t + ahead */
byte wall = kZero;            /* the receiver's clock shows t + wall */
byte live;                    /* the sender's session; lower ones have ended */

/* Messages that were sent; their numbers rise in a session. */
byte sent;
byte session_of[kMessages];
byte sent_at[kMessages];      /* the sender's clock */

/* The receiver: SessionReplayFilter. */
bool is_known[kSessions];
bool has_responded[kSessions];
byte base[kSessions];         /* of the fastest message: sender's clock when sent, minus true time when received */
byte newest_sent[kSessions];
byte received;                /* messages of known sessions, as bits */
byte floor;
byte first_live;              /* the sender's session when the receiver started */

/* SessionChallenges. A nonce is random, so a response fits only the challenge that is pending. */
#define kNone 0
#define kPending 1
#define kPendingLong 2        /* pending across the end of a tick */
byte challenge[kSessions];
bool has_response[kSessions]; /* a response was sent */
byte response_newest[kSessions];
byte response_sent[kSessions];

/* Past events, for the checks and their bounds. */
byte accepted;                /* all accepted health */
#ifdef LIVENESS
bool was_heard;               /* the previous step accepted health of the live sender */
#define heard was_heard = true
#define quiet was_heard = false
#else
#define heard skip
#define quiet skip
#endif
bool sender_stepped, receiver_stepped, receiver_restarted;
hidden byte k;
hidden byte is_recent, was_known, k_newest, k_sent, k_late;

/* Needed only where sessions are forgotten. */
#if kMaxSessions == 1
#define note_sent(s, at) newest_sent[s] = at
#else
#define note_sent(s, at) skip
#endif
#define is_in(set, i) (((set) >> (i)) & 1)
#define is_health(i) (!is_in(kData, i))
/* True when a message is neither from the future nor too old by the two clocks. */
#define agrees(clock, at) ((clock) >= (at) && (clock) <= (at) + kOldest)

inline forget_messages_of(s) {
  for (k : 0 .. kMessages - 1) {
    if
    :: session_of[k] == s -> received = received & ~(1 << k)
    :: else
    fi
  }
  k = 0
}

inline forget_session(s) {
  is_known[s] = false; has_responded[s] = false; base[s] = 0; newest_sent[s] = 0;
  forget_messages_of(s)
}

inline end_challenge(s) {
  challenge[s] = kNone;
#ifndef RESPONSE_WITHOUT_NONCE
  has_response[s] = false; response_newest[s] = 0; response_sent[s] = 0
#endif
}

/* A response to an earlier challenge may be older than messages received from a session that is forgotten now. */
inline forget_challenges() {
#ifndef RESPONSE_OF_FORGOTTEN_SESSION
  end_challenge(0); end_challenge(1)
#else
  skip
#endif
}

/* SessionReplayFilter::find_or_add() */
inline add(s) {
  if
  :: !is_known[s] ->
    if
    :: kMaxSessions == 1 && is_known[1 - s] ->
      floor = (newest_sent[1 - s] > floor -> newest_sent[1 - s] : floor);
      forget_session(1 - s);
      forget_challenges()
    :: else
    fi;
    is_known[s] = true
  :: else
  fi
}

inline send_challenge(s) {
  if
#ifdef NO_CHALLENGES
  :: challenge[s] == kNone
#else
  :: challenge[s] == kNone -> challenge[s] = kPending
#endif
  :: else
  fi
}

/* A message that seems old causes a challenge although its session has responded (MessageReceiver::is_recent()). */
#define seems_old(s, at) (is_known[s] && t + base[s] >= (at))

/* SessionReplayFilter::is_recent() */
inline judge(s, at) {
  if
  :: is_known[s] -> is_recent = agrees(t + base[s], at)
  :: else -> is_recent = agrees(t + wall, at) && at > floor
  fi
}

/* SessionReplayFilter::note() */
inline note(s, at) {
  if
  :: !is_known[s] -> add(s); base[s] = at - t
  :: is_known[s] && t + base[s] <= at -> base[s] = at - t
  :: else
  fi;
  note_sent(s, (at > newest_sent[s] -> at : newest_sent[s]))
}

#ifdef ACCEPT_BY_CLOCK
#define needs_challenge(s) false
#else
#define needs_challenge(s) (!has_responded[s])
#endif

/* MessageReceiver::receive_authentic() */
inline arrive(i, s) {
  judge(s, sent_at[i]);
  if
  :: is_known[s] && is_in(received, i)
  :: !(is_known[s] && is_in(received, i)) && (!is_recent || (is_health(i) && needs_challenge(s))) -> send_challenge(s)
  :: !(is_known[s] && is_in(received, i)) && is_recent && !(is_health(i) && needs_challenge(s)) ->
    if
    :: is_health(i) ->
      assert(!is_in(accepted, i));
      assert(s >= first_live);
      assert(sender_stepped || t + ahead <= sent_at[i] + kOldest + 1);
      accepted = accepted | (1 << i);
      if
      :: seems_old(s, sent_at[i]) -> send_challenge(s)
      :: true  /* younger than 10 ms; a tick is longer */
      fi
    :: else
    fi;
    note(s, sent_at[i]);
    received = received | (1 << i)
  fi
}

/* MessageReceiver::on_response(), SessionReplayFilter::accept(). The response of a known session changes the comparison
 * of clocks only if it seems younger than all messages, or older than its challenge. */
inline accept_response(s) {
  was_known = is_known[s]; k_newest = response_newest[s]; k_sent = response_sent[s];
  k_late = (challenge[s] == kPendingLong);
  end_challenge(s);
  add(s);
  if
  :: was_known && t + base[s] > k_sent && t + base[s] <= k_sent + k_late
  :: else -> base[s] = k_sent - t
  fi;
  note_sent(s, k_sent);
  if
#ifdef KEEP_OLDER_AT_RESPONSE
  :: !was_known ->
#else
  :: !has_responded[s] ->
#endif
    for (k : 0 .. kMessages - 1) {
      if
      :: session_of[k] == s && k < k_newest -> received = received | (1 << k)
      :: else
      fi
    }
    k = 0
  :: else
  fi;
  has_responded[s] = true
}

#ifdef RESPONSE_WITHOUT_NONCE
#define may_accept_response(s) has_response[s]
#else
#define may_accept_response(s) (challenge[s] != kNone && has_response[s])
#endif

/* Messages arrive in any order, late, and again. */
proctype Adversary() {
  byte i;
end:
  do
  :: atomic { sent > 0 -> select(i : 0 .. sent - 1); quiet; arrive(i, session_of[i]); i = 0 }
  :: atomic { may_accept_response(0) -> quiet; accept_response(0) }
  od
}

/* The next health of the live sender, not yet recorded by the adversary, arrives at once. */
proctype Health() {
end:
  do
  :: atomic {
       judge(live, t + ahead);
       if
       :: is_recent && !needs_challenge(live) -> note(live, t + ahead); heard;
         if
         :: seems_old(live, t + ahead) -> send_challenge(live)
         :: true
         fi
       :: else -> send_challenge(live); quiet
       fi
     }
  od
}

proctype Response() {
end:
  do
  :: atomic {
       challenge[live] != kNone && !has_response[live] -> quiet;
       has_response[live] = true; response_newest[live] = sent; response_sent[live] = t + ahead
     }
  od
}

proctype ResponseArrives() {
end:
  do
  :: atomic { may_accept_response(live) -> quiet; accept_response(live) }
  od
}

/* A challenge is pending for less than a tick. */
inline age_challenge(s) {
  if
  :: challenge[s] == kPending -> challenge[s] = kPendingLong
  :: challenge[s] != kNone -> end_challenge(s)
  :: else
  fi
}

proctype Senders() {
end:
  do
  :: atomic { sent < kMessages -> quiet; session_of[sent] = live; sent_at[sent] = t + ahead; sent++ }
  :: atomic { live + 1 < kSessions -> quiet; live++ }
  :: atomic { !sender_stepped -> quiet; sender_stepped = true;
       if
       :: ahead = kZero - 1
       :: ahead = kZero + 1
       fi
     }
  od
}

proctype Receivers() {
end:
  do
  :: atomic { t < kEnd -> quiet; t++; age_challenge(0); age_challenge(1) }
  :: atomic { !receiver_stepped -> quiet; receiver_stepped = true;
       if
       :: wall = kZero - 1
       :: wall = kZero + 1
       fi
     }
  :: atomic {
       !receiver_restarted -> quiet; receiver_restarted = true; first_live = live; floor = 0;
       forget_session(0); forget_session(1); end_challenge(0); end_challenge(1)
     }
  od
}

init { atomic { run Adversary(); run Health(); run Response(); run ResponseArrives(); run Senders(); run Receivers() } }

#ifdef LIVENESS
ltl live_sender_is_heard { [] <> was_heard }
#endif
