/* Spin model of nodes that crash in a take and rejoin it (docs/protocol.md, "Crashes").
 *
 * All nodes are armed for one take. An operator starts it, and may give up at every step. A last operator stops and
 * aborts. Nodes crash kCrashes times in total, including the trigger's node (0). The others learn from its health whether
 * pulses run. Health is lost and delayed; a node ignores messages that are older than the last one (HealthOrder). After a
 * restart a node accepts only later messages: earlier ones belong to sessions that have not responded (session.pml). Before
 * a recording ends, messages from before the start do not count (TrainState::kMaxAge). Checked in every state:
 *   - pulses begin only after every node records;
 *   - pulses run only while the trigger's node records: its crash ends them;
 *   - while pulses run, only a stopped node regards them as ended;
 *   - a node rejoins a take only if the trigger's node has recorded it since the restart;
 *   - at the end, after a stop and an abort, every node is idle;
 *   - a node that crashes while pulses run rejoins, unless the pulses end (LTL, weak fairness).
 *
 * Macros switch on faults, to show that the model finds them: START_ALL_AT_ONCE (the trigger's node starts with the
 * others), PULSES_SURVIVE (pulses continue when the trigger's node crashes), STALE_HEALTH (a node accepts health from before
 * its restart), LATE_HEALTH (a node accepts health from before the trigger's node was armed), DEAF (no node receives health of the trigger's node, and only that node receives the stop). */

#ifndef NODES
#define NODES 3
#endif
#ifndef kCrashes
#define kCrashes 2
#endif
#define ALL ((1 << NODES) - 1)
#define OTHERS (ALL - 1)
#define OPERATORS 2
#define LAST 1
#define kMaxHealth 10

#define cmd(op, c) ((op) * 4 + (c))
#define verb_of(op, c) verb[cmd(op, c)]
#define own_of(op, c) own[cmd(op, c)]
#define is_about_other(op, c, t) false
#define input_of(op, n, c) verb[cmd(op, c)]
#define last_stale(op) (sent[op] > 0 -> sent[op] - 1 : 0)
#include "node.pml"

byte verb[4 * OPERATORS];
byte addressed[4 * OPERATORS]; /* nodes */
bool own[4 * OPERATORS];
byte sent[OPERATORS];
byte crashes;
bool is_stopped;               /* the last operator has started */
bool has_started;              /* the first operator has ended */
bool pulses;

/* Phases of the trigger's node, in the order in which its health shows them; the last one is repeated. */
byte health[kMaxHealth];
byte newest;
byte last_health[NODES];       /* index of the last health that the node has received or must ignore */
bool crashed_in_take;          /* node 1 crashed while pulses ran */

#define has(set, node) (((set) >> (node)) & 1)
#define runs(p) ((p) == P_armed || (p) == P_recording)

#ifdef PULSES_SURVIVE
#define keeps_pulses(n) (phase[n] == P_idle && may_rejoin[n])
#else
#define keeps_pulses(n) false
#endif

#ifdef DEAF
#define receives_health(n) false
#else
#define receives_health(n) (n != TRIGGER)
#endif

inline on_start(n) {
  if
  :: n == TRIGGER ->
    for (o : 1 .. NODES - 1) {
      assert(records[o] == take[TRIGGER])
    }
    o = 0;
    pulses = true
  :: else
  fi
}

/* After each step of a node: effects of its work, and new health. */
inline after_step(n) {
  if
  :: n == TRIGGER && phase[n] != P_recording && !keeps_pulses(n) -> pulses = false
  :: else
  fi;
  if
  :: n == TRIGGER && phase[n] != health[newest] -> newest++; health[newest] = phase[n]
  :: else
  fi;
  assert(!pulses || phase[TRIGGER] == P_recording);
  if
  :: phase[1] == P_recording || !pulses -> crashed_in_take = false
  :: else
  fi;
  owner = 0; misses = false
}
#define can(op, c) (c <= sent[op] && c > executed[at(op, n)] && has(addressed[cmd(op, c)], n))

proctype Node(byte n) {
  byte op, c, owner, o, h;
  bool misses;
end:
  do
  :: atomic {
       if
       :: can(0, 1) -> op = 0; c = 1
       :: can(0, 2) -> op = 0; c = 2
       :: can(1, 1) -> op = 1; c = 1
       :: can(1, 2) -> op = 1; c = 2
       fi;
       execute(op, n, c); op = 0; c = 0; after_step(n)
     }
  :: atomic { phase[n] == P_draining -> report(n, I_drained, O_done); after_step(n) }
  :: atomic {
       receives_health(n) && phase[n] == P_recording && (last_health[n] < newest || !runs(health[newest])) ->
       if
       :: last_health[n] < newest -> select(h : last_health[n] + 1 .. newest)
       :: else -> h = newest
       fi;
       last_health[n] = h;
       if
       :: !runs(health[h]) -> assert(!pulses); report(n, I_train_ended, O_done)
       :: else
       fi;
       h = 0; after_step(n)
     }
  :: atomic {
       receives_health(n) && may_rejoin[n] && phase[n] == P_idle -> select(h : last_health[n] .. newest);
       if
       :: health[h] == P_recording -> last_health[n] = h; rejoin(n)
       :: else -> may_rejoin[n] = false
       fi;
       h = 0; after_step(n)
     }
  :: atomic {
       crashes < kCrashes && !is_stopped -> crashes++;
       if
       :: n == 1 && pulses && phase[n] == P_recording -> crashed_in_take = true
       :: else
       fi;
       crash(n);
#ifndef STALE_HEALTH
       last_health[n] = newest;
#endif
       after_step(n)
     }
  od
}

#define answered(op, n, c) (executed[at(op, n)] == (c) && reply_of[at(op, n)] != O_none)
#define final(op, n, c) (answered(op, n, c) && reply_of[at(op, n)] != O_pending)
#define done(op, n, c) (answered(op, n, c) && reply_of[at(op, n)] == O_done)
#define refused(op, n, c) (answered(op, n, c) && reply_of[at(op, n)] == O_refused)
#if NODES == 3
#define others(what, op, c) (what(op, 1, c) && what(op, 2, c))
#define all_idle (phase[0] == P_idle && phase[1] == P_idle && phase[2] == P_idle)
#else
#define others(what, op, c) what(op, 1, c)
#define all_idle (phase[0] == P_idle && phase[1] == P_idle)
#endif

inline send(op, what, nodes, only_own) {
  atomic {
    sent[op]++;
    verb[cmd(op, sent[op])] = what; addressed[cmd(op, sent[op])] = nodes; own[cmd(op, sent[op])] = only_own
  }
}

proctype Starter() {
#ifdef START_ALL_AT_ONCE
  send(0, I_start, ALL, false);
#else
  send(0, I_start, OTHERS, false);
  if
  :: others(done, 0, 1) -> addressed[cmd(0, 1)] = ALL
  :: true -> goto take_back
  fi;
#endif
  if
  :: done(0, TRIGGER, 1) -> goto quit
  :: true
  fi;
take_back:
  send(0, I_abort, 1, true);
  if
  :: answered(0, TRIGGER, 2) && !refused(0, TRIGGER, 2) ->
    atomic { own[cmd(0, 2)] = false; addressed[cmd(0, 2)] = ALL }
  :: true
  fi;
quit:
  has_started = true
}

proctype Last() {
  has_started;
#ifdef WAITS
  false; /* no operator stops the take */
#endif
  is_stopped = true;
#ifdef DEAF
  send(LAST, I_stop, 1, false)
#else
  send(LAST, I_stop, ALL, false);
  final(LAST, TRIGGER, 1) && others(final, LAST, 1);
  send(LAST, I_abort, ALL, false)
#endif
}

init {
  byte i;
  atomic {
    fill_table();
    for (i : 0 .. NODES - 1) {
      phase[i] = P_armed; take[i] = 0; kept[i] = 0
    }
    health[0] = P_idle; health[1] = P_idle; health[2] = P_armed; newest = 2;
#ifndef LATE_HEALTH
    for (i : 0 .. NODES - 1) { last_health[i] = newest }
#endif
    for (i : 0 .. NODES - 1) { run Node(i) }
    run Starter(); run Last()
  }
#ifndef WAITS
  timeout -> assert(is_stopped && all_idle)
#endif
}

#ifdef WAITS
ltl records_again { [] (crashed_in_take -> <> !crashed_in_take) }
#endif
