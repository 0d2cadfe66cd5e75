/* Spin model of replay protection: how one node decides which commands of an operator are new (docs/protocol.md,
 * daemon/control/command_replay_filter.h, StudioCoordinator::learn_nonce()).
 *
 * An operator sends a start, then a stop, each until the node has answered. Each transmission has a stamp and the nonce
 * that the operator learnt from a reply. The network loses some transmissions and replies. An adversary repeats any earlier
 * command and reply at any time, any number of times. The node draws new nonces, and crashes once. Checked in every state:
 *   - no transmission is executed twice, and none after a later one of its sender;
 *   - the stop is executed and answered in the end (LTL, weak fairness).
 *
 * Macros switch on three faults, to show that the model finds them: OBEY_WITHOUT_NONCE, WALL_CLOCK_STAMPS (stamps follow
 * a clock that is set back), NONCE_OF_ANY_REPLY (repeated replies restore old nonces). */

#define kMaxSent 13   /* transmissions; the operator needs fewer */
#define kMaxEpochs 3  /* nonces that the node draws */
#ifndef kMaxLost
#define kMaxLost 0    /* transmissions and replies that the network loses; the search for 1 takes 30 times as long */
#endif
#if defined(OBEY_WITHOUT_NONCE) || defined(WALL_CLOCK_STAMPS) || defined(NONCE_OF_ANY_REPLY)
#define FAULT
#define matters(i) true
#else
#define matters(i) ((i) > known_from) /* the operator uses replies to these */
#endif
#define kStart 1
#define kStop 2

/* Transmissions, numbered from 1. CommandStamp makes stamps increase for every clock, so only their order matters. Without
 * CommandStamp a stamp is the time of the clock. */
#ifdef WALL_CLOCK_STAMPS
byte stamp[kMaxSent + 1];
#define stamp_of(i) stamp[i]
#else
#define stamp_of(i) (i)
#endif
byte counter[kMaxSent + 1];
byte nonce[kMaxSent + 1];     /* 0: none */
byte sent;                    /* the newest transmission */
bool on_its_way;              /* the newest transmission has neither arrived nor been lost */
byte lost;

/* All replies that were sent; the adversary has recorded them. A repeated transmission is answered again, so a reply "send
 * again with this nonce" may hold any nonce from arrived_in on. */
byte arrived_in[kMaxSent + 1];   /* the node's nonce at the first arrival; 0: not arrived, or irrelevant */
byte answered_in[kMaxSent + 1];  /* the node's nonce in the reply "done"; 0: there is none */
bool reply_on_its_way;           /* the newest reply to the newest transmission has not arrived */
bool reply_asks_again;
bool must_repeat = true;         /* the operator's next transmission is due: at once, or 200 ms after the last */

/* The node. */
byte epoch = 1;               /* its nonce */
byte epoch_before;            /* the previous nonce, while it is accepted; 0: none */
byte last_stamp, last_counter;                /* of the sender, since the nonce was drawn; 0: nothing received */
byte last_stamp_before, last_counter_before;  /* the same for the previous nonce */
byte newest_executed;         /* the newest executed transmission */
bool crashed;
hidden byte k;

/* The operator. */
byte command = kStart;
byte known_nonce;
byte known_from;              /* stamp of the command whose reply held it */
byte clock = 6;
bool stopped;                 /* the stop is answered */

#define is_current(n) ((n) != 0 && ((n) == epoch || (n) == epoch_before))
#define is_after(s, c, ls, lc) ((ls) == 0 || ((s) > (ls) && (c) >= (lc)))
#define is_new(i) (is_after(stamp_of(i), counter[i], last_stamp, last_counter) && \
                   is_after(stamp_of(i), counter[i], last_stamp_before, last_counter_before))

/* CommandReplayFilter::admit() and Controller::on_command(). */
inline arrive(i) {
  if
  :: arrived_in[i] == 0 && matters(i) -> arrived_in[i] = epoch
  :: else
  fi;
  if
#ifndef OBEY_WITHOUT_NONCE
  :: !is_current(nonce[i]) ->
    if
    :: i == sent -> reply_on_its_way = true; reply_asks_again = true
    :: else
    fi
#endif
  :: is_current(nonce[i]) && !is_new(i)
#ifdef OBEY_WITHOUT_NONCE
  :: !is_current(nonce[i]) || is_new(i) ->
#else
  :: is_current(nonce[i]) && is_new(i) ->
#endif
    assert(i > newest_executed);
    newest_executed = i;
    last_stamp = stamp_of(i); last_counter = counter[i];

    answered_in[i] = epoch;
    if
    :: i == sent -> reply_on_its_way = true; reply_asks_again = false
    :: else
    fi
  fi
}

/* Resets values without further effect, to reduce the number of states: nonces that the node does not accept, and
 * replies that the operator does not use. */
inline forget() {
  for (k : 1 .. kMaxSent) {
    if
    :: !is_current(nonce[k]) -> nonce[k] = 0
    :: else
    fi;
#ifndef FAULT
    if
    :: !matters(k) -> arrived_in[k] = 0
    :: else
    fi;
    if
    :: !matters(k) && counter[k] < command -> answered_in[k] = 0
    :: else
    fi
#endif
  }
  k = 0
}

/* StudioCoordinator::on_reply(): handles the reply to transmission i that holds nonce e. */
inline receive_reply(i, e, asks_again) {
  if
#ifdef NONCE_OF_ANY_REPLY
  :: true ->
#else
  :: stamp_of(i) > known_from ->
#endif
    if
    :: asks_again && e != known_nonce -> must_repeat = true
    :: else
    fi;
    known_nonce = e; known_from = stamp_of(i);
    forget()
#ifndef NONCE_OF_ANY_REPLY
  :: else
#endif
  fi;
  if
  :: !asks_again && counter[i] == command && command == kStart -> command = kStop; must_repeat = true; forget()
  :: !asks_again && counter[i] == command && command == kStop -> stopped = true
  :: else
  fi
}

proctype Operator() {
  do
  :: atomic {
       must_repeat && !stopped && sent < kMaxSent ->
       sent++;
       counter[sent] = command; nonce[sent] = known_nonce;
#ifdef WALL_CLOCK_STAMPS
       stamp[sent] = clock; clock++;
#endif
       on_its_way = true; reply_on_its_way = false; must_repeat = false
     }
  :: stopped -> break
  od
}

#ifdef WALL_CLOCK_STAMPS
/* The operator's wall clock is set back once. */
proctype Clock() { clock = 1 }
#endif

proctype Network() {
end:
  do
  :: atomic { on_its_way -> on_its_way = false; arrive(sent); must_repeat = must_repeat || !reply_on_its_way }
  :: atomic { on_its_way && lost < kMaxLost -> lost++; on_its_way = false; must_repeat = true }
  :: atomic { reply_on_its_way -> reply_on_its_way = false;
       if
       :: reply_asks_again -> receive_reply(sent, epoch, true)
       :: else -> receive_reply(sent, epoch, false)
       fi;
       must_repeat = true
     }
  :: atomic { reply_on_its_way && lost < kMaxLost -> lost++; reply_on_its_way = false; must_repeat = true }
  od
}

/* The adversary: repeats commands and replies. */
proctype Adversary() {
  byte i, e;
end:
  do
  :: atomic { sent > 0 -> select(i : 1 .. sent);
       if
       :: i < sent || !on_its_way -> arrive(i)
       :: else
       fi;
       i = 0
     }
  :: atomic { sent > 0 && !stopped -> select(i : 1 .. sent); select(e : 1 .. epoch);
       if
       :: arrived_in[i] != 0 && e >= arrived_in[i] -> receive_reply(i, e, true)
       :: answered_in[i] == e -> receive_reply(i, e, false)
       :: else
       fi;
       i = 0; e = 0
     }
  od
}

/* The node over time: draws nonces; restarts after a crash. */
proctype Node() {
end:
  do
  :: atomic {  /* CommandReplayFilter::renew_nonces() */
       epoch < kMaxEpochs && !stopped -> epoch_before = epoch; epoch++; forget();
       last_stamp_before = last_stamp; last_counter_before = last_counter;
       last_stamp = 0; last_counter = 0
     }
  :: atomic { epoch_before != 0 && !stopped -> epoch_before = 0; forget(); last_stamp_before = 0; last_counter_before = 0 }
  :: atomic {
       epoch < kMaxEpochs && !crashed && !stopped -> crashed = true; epoch++; epoch_before = 0; forget();
       last_stamp = 0; last_counter = 0; last_stamp_before = 0; last_counter_before = 0;
       reply_on_its_way = false; must_repeat = true
     }
  od
}

init { atomic { run Operator(); run Network(); run Adversary(); run Node() }
#ifdef WALL_CLOCK_STAMPS
  run Clock()
#endif
}

ltl stop_is_executed { <> stopped }
