/* Spin model of sessions: which health and pulses a receiver accepts (docs/security.md, "Clocks";
 * daemon/bus/session_replay_filter.h, daemon/bus/message_receiver.cc).
 *
 * A sender sends health and data (frames, events) in two sessions: its process restarts once. Its clock is set once,
 * forwards or backwards. The receiver restarts once, and its wall clock is set once. An adversary delivers any earlier
 * message at any time, any number of times, and delays questions and answers. The receiver remembers kMaxSessions
 * sessions. A tick is 5 s (SessionReplayFilter::kOldest). Checked in every state:
 *   - no health is accepted twice, for all restarts and clock settings;
 *   - after its restart the receiver accepts no health of a session that had ended before;
 *   - without a step of the sender's clock, no health is accepted that is older than kOldest and the time of an answer;
 *   - the health of a live sender is accepted repeatedly (LTL, weak fairness).
 *
 * Macros switch on faults, to show that the model finds them: ACCEPT_BY_CLOCK (an unknown session whose time
 * agrees with the wall clock needs no answer), KEEP_OLDER_AT_ANSWER (the first answer of a known session leaves older
 * messages acceptable), ANSWER_WITHOUT_NONCE (old answers are accepted), ANSWER_OF_FORGOTTEN_SESSION (a
 * question remains pending when its session is forgotten), ASK_NOBODY (unknown sessions are not asked). */

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
bool has_answered[kSessions];
byte base[kSessions];         /* of the fastest message: sender's clock when sent, minus true time when received */
byte newest_sent[kSessions];
byte received;                /* messages of known sessions, as bits */
byte floor;
byte first_live;              /* the sender's session when the receiver started */

/* SessionQuestions. A nonce is random, so an answer fits only the question that is pending. */
#define kNone 0
#define kPending 1
#define kPendingLong 2        /* pending across the end of a tick */
byte question[kSessions];
bool is_answered[kSessions];  /* an answer was sent */
byte answer_newest[kSessions];
byte answer_sent[kSessions];

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
  is_known[s] = false; has_answered[s] = false; base[s] = 0; newest_sent[s] = 0;
  forget_messages_of(s)
}

inline end_question(s) {
  question[s] = kNone;
#ifndef ANSWER_WITHOUT_NONCE
  is_answered[s] = false; answer_newest[s] = 0; answer_sent[s] = 0
#endif
}

/* An answer to an earlier question may be older than messages received from a session that is forgotten now. */
inline forget_questions() {
#ifndef ANSWER_OF_FORGOTTEN_SESSION
  end_question(0); end_question(1)
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
      forget_questions()
    :: else
    fi;
    is_known[s] = true
  :: else
  fi
}

inline ask(s) {
  if
#ifdef ASK_NOBODY
  :: question[s] == kNone
#else
  :: question[s] == kNone -> question[s] = kPending
#endif
  :: else
  fi
}

/* A message that seems old raises a question although its session has answered (MessageReceiver::is_recent()). */
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
#define needs_answer(s) false
#else
#define needs_answer(s) (!has_answered[s])
#endif

/* MessageReceiver::receive_authentic() */
inline arrive(i, s) {
  judge(s, sent_at[i]);
  if
  :: is_known[s] && is_in(received, i)
  :: !(is_known[s] && is_in(received, i)) && (!is_recent || (is_health(i) && needs_answer(s))) -> ask(s)
  :: !(is_known[s] && is_in(received, i)) && is_recent && !(is_health(i) && needs_answer(s)) ->
    if
    :: is_health(i) ->
      assert(!is_in(accepted, i));
      assert(s >= first_live);
      assert(sender_stepped || t + ahead <= sent_at[i] + kOldest + 1);
      accepted = accepted | (1 << i);
      if
      :: seems_old(s, sent_at[i]) -> ask(s)
      :: true  /* younger than 10 ms; a tick is longer */
      fi
    :: else
    fi;
    note(s, sent_at[i]);
    received = received | (1 << i)
  fi
}

/* MessageReceiver::on_answer(), SessionReplayFilter::accept(). The answer of a known session changes the comparison of
 * clocks only if it seems younger than all messages, or older than its question. */
inline take_answer(s) {
  was_known = is_known[s]; k_newest = answer_newest[s]; k_sent = answer_sent[s];
  k_late = (question[s] == kPendingLong);
  end_question(s);
  add(s);
  if
  :: was_known && t + base[s] > k_sent && t + base[s] <= k_sent + k_late
  :: else -> base[s] = k_sent - t
  fi;
  note_sent(s, k_sent);
  if
#ifdef KEEP_OLDER_AT_ANSWER
  :: !was_known ->
#else
  :: !has_answered[s] ->
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
  has_answered[s] = true
}

#ifdef ANSWER_WITHOUT_NONCE
#define may_take_answer(s) is_answered[s]
#else
#define may_take_answer(s) (question[s] != kNone && is_answered[s])
#endif

/* Messages arrive in any order, late, and again. */
proctype Adversary() {
  byte i;
end:
  do
  :: atomic { sent > 0 -> select(i : 0 .. sent - 1); quiet; arrive(i, session_of[i]); i = 0 }
  :: atomic { may_take_answer(0) -> quiet; take_answer(0) }
  od
}

/* The next health of the live sender, not yet recorded by the adversary, arrives at once. */
proctype Health() {
end:
  do
  :: atomic {
       judge(live, t + ahead);
       if
       :: is_recent && !needs_answer(live) -> note(live, t + ahead); heard;
         if
         :: seems_old(live, t + ahead) -> ask(live)
         :: true
         fi
       :: else -> ask(live); quiet
       fi
     }
  od
}

proctype Answer() {
end:
  do
  :: atomic {
       question[live] != kNone && !is_answered[live] -> quiet;
       is_answered[live] = true; answer_newest[live] = sent; answer_sent[live] = t + ahead
     }
  od
}

proctype AnswerArrives() {
end:
  do
  :: atomic { may_take_answer(live) -> quiet; take_answer(live) }
  od
}

/* A question is pending for less than a tick. */
inline age_question(s) {
  if
  :: question[s] == kPending -> question[s] = kPendingLong
  :: question[s] != kNone -> end_question(s)
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
  :: atomic { t < kEnd -> quiet; t++; age_question(0); age_question(1) }
  :: atomic { !receiver_stepped -> quiet; receiver_stepped = true;
       if
       :: wall = kZero - 1
       :: wall = kZero + 1
       fi
     }
  :: atomic {
       !receiver_restarted -> quiet; receiver_restarted = true; first_live = live; floor = 0;
       forget_session(0); forget_session(1); end_question(0); end_question(1)
     }
  od
}

init { atomic { run Adversary(); run Health(); run Answer(); run AnswerArrives(); run Senders(); run Receivers() } }

#ifdef LIVENESS
ltl live_sender_is_heard { [] <> was_heard }
#endif
