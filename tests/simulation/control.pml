/* Spin model of the control protocol (docs/protocol.md). Nodes use the transition table of the daemons: transitions.pml is
 * generated from daemon/control/control.h.
 *
 * Each operator arms, starts and stops its own take, and may give up at every step. After all others have ended, a last
 * operator stops and aborts. Node 0 has the trigger. Messages are lost, repeated and reordered: a command reaches a node
 * once, at any later time, unless the node has executed a later command of the same operator. A reply reaches the operator at
 * any later time, or not at all. A node may crash once. */

/* Two sizes are checked: NODES=2 with PEOPLE=2, and NODES=3 with PEOPLE=1. */
#ifndef NODES
#define NODES 2
#endif
#ifndef PEOPLE
#define PEOPLE 2
#endif
#define ALL ((1 << NODES) - 1)
#define OTHERS (ALL - 1)
#define OPERATORS (PEOPLE + 1)
#define LAST PEOPLE /* the last operator, who stops and aborts */

#define cmd(op, counter) ((op) * 8 + (counter))
#define verb_of(op, c) verb[cmd(op, c)]
#define own_of(op, c) own[cmd(op, c)]
#define is_about_other(op, c, t) (about[cmd(op, c)] != NOBODY && about[cmd(op, c)] != t)
#define input_of(op, n, c) verb[cmd(op, c)]
/* After a crash a node rejects all commands sent before, except the last one of each operator, which is sent again. */
#define last_stale(op) (sent[op] > 0 -> sent[op] - 1 : 0)
#include "node.pml"

/* Commands, by operator and counter. */
byte verb[8 * OPERATORS];
byte addressed[8 * OPERATORS]; /* nodes */
byte about[8 * OPERATORS];     /* take; NOBODY: any */
bool own[8 * OPERATORS];
byte sent[OPERATORS];

bool crashed;
bool ending; /* the last operator has started */
byte gone;   /* number of operators that have ended */

#define has(set, node) (((set) >> (node)) & 1)

/* Pulses begin only after every node records the take. */
inline on_start(n) {
  if
  :: n == TRIGGER ->
    for (o : 1 .. NODES - 1) {
      assert(records[o] == take[TRIGGER])
    }
    o = 0
  :: else
  fi
}

/* A failed start never takes back a running recording. */
inline check_take_back(op, n, c) {
  judge(op, n, c);
  assert(misses || !(own_of(op, c) && n != TRIGGER && phase[n] == P_recording && phase[TRIGGER] == P_recording &&
                     take[TRIGGER] == take[n]))
}

#define can(op, c) (c <= sent[op] && c > executed[at(op, n)] && has(addressed[cmd(op, c)], n))

/* Events at node n: a message of any operator arrives, or the node's own work reports. */
proctype Node(byte n) {
  byte op, c, owner, o;
  bool misses;
end:
  do
  :: atomic {
       /* A command, if the node has executed neither it nor a later one of its sender. */
       if
       :: can(0, 1) -> op = 0; c = 1
       :: can(0, 2) -> op = 0; c = 2
       :: can(0, 3) -> op = 0; c = 3
       :: can(0, 4) -> op = 0; c = 4
       :: can(0, 5) -> op = 0; c = 5
       :: can(0, 6) -> op = 0; c = 6
       :: can(1, 1) -> op = 1; c = 1
       :: can(1, 2) -> op = 1; c = 2
       :: can(1, 3) -> op = 1; c = 3
       :: can(1, 4) -> op = 1; c = 4
       :: can(1, 5) -> op = 1; c = 5
       :: can(1, 6) -> op = 1; c = 6
#if PEOPLE == 2
       :: can(2, 1) -> op = 2; c = 1
       :: can(2, 2) -> op = 2; c = 2
       :: can(2, 3) -> op = 2; c = 3
       :: can(2, 4) -> op = 2; c = 4
       :: can(2, 5) -> op = 2; c = 5
       :: can(2, 6) -> op = 2; c = 6
#endif
       fi;
       check_take_back(op, n, c); execute(op, n, c); op = 0; c = 0
     }
  :: atomic { phase[n] == P_arming -> report(n, I_ready, O_done) }
  :: atomic { phase[n] == P_arming && !ending -> report(n, I_failed, O_refused) }
  :: atomic { phase[n] == P_prepared -> report(n, I_expired, O_refused) }
  :: atomic { phase[n] == P_draining -> report(n, I_drained, O_done) }
  :: atomic { /* health of the trigger's node arrives */
       n != TRIGGER && phase[n] == P_recording &&
           !(take[TRIGGER] == take[n] && (phase[TRIGGER] == P_armed || phase[TRIGGER] == P_recording)) ->
         report(n, I_train_ended, O_done)
     }
  :: atomic {
       n != TRIGGER && may_rejoin[n] && phase[n] == P_idle && phase[TRIGGER] == P_recording ->
       if
       :: kept[n] == take[TRIGGER] -> rejoin(n)
       :: else -> may_rejoin[n] = false
       fi
     }
  :: atomic {
       !crashed && !ending -> crashed = true;
       crash(n)
     }
  od
}

#define answered(op, n, counter) (executed[at(op, n)] == (counter) && reply_of[at(op, n)] != O_none)
#define final(op, n, counter) (answered(op, n, counter) && reply_of[at(op, n)] != O_pending)
#define refused(op, n, counter) (answered(op, n, counter) && reply_of[at(op, n)] == O_refused)
#if NODES == 3
#define others_final(op, counter) (final(op, 1, counter) && final(op, 2, counter))
#define other_refused(op, counter) (refused(op, 1, counter) || refused(op, 2, counter))
#define all_idle (phase[0] == P_idle && phase[1] == P_idle && phase[2] == P_idle)
#else
#define others_final(op, counter) final(op, 1, counter)
#define other_refused(op, counter) refused(op, 1, counter)
#define all_idle (phase[0] == P_idle && phase[1] == P_idle)
#endif
#define all_final(op, counter) (final(op, 0, counter) && others_final(op, counter))
#define one_refused(op, counter) (refused(op, 0, counter) || other_refused(op, counter))

inline send(what, nodes, whose, only_own) {
  atomic {
    sent[id]++;
    verb[cmd(id, sent[id])] = what; addressed[cmd(id, sent[id])] = nodes;
    about[cmd(id, sent[id])] = whose; own[cmd(id, sent[id])] = only_own
  }
}

/* Sends the same command to more nodes. */
inline send_to(nodes) { atomic { addressed[cmd(id, sent[id])] = nodes } }

proctype Operator(byte id) {
  bool ok;
  send(I_arm, 1, id, false);
  if
  :: answered(id, TRIGGER, sent[id]) && !refused(id, TRIGGER, sent[id])
  :: refused(id, TRIGGER, sent[id]) -> goto quit
  :: true -> send(I_abort, 1, id, true); goto quit /* the deadline has passed */
  fi;
  send_to(ALL);
  if
  :: all_final(id, sent[id]) && !one_refused(id, sent[id])
  :: one_refused(id, sent[id]) -> send(I_abort, ALL, id, true); goto quit
  :: true -> send(I_abort, ALL, id, true); goto quit
  fi;
  send(I_commit, ALL, id, false);
  if
  :: all_final(id, sent[id]) && !one_refused(id, sent[id])
  :: one_refused(id, sent[id]) -> send(I_abort, ALL, id, true); goto quit
  :: true -> send(I_abort, ALL, id, true); goto quit
  fi;
  if
  :: goto quit
  :: true
  fi;
  send(I_start, OTHERS, id, false);
  if
  :: others_final(id, sent[id]) && !other_refused(id, sent[id])
  :: other_refused(id, sent[id]) -> goto take_back
  :: true -> goto take_back
  fi;
  send_to(ALL);
  if
  :: final(id, TRIGGER, sent[id]) && !refused(id, TRIGGER, sent[id]) -> goto stop
  :: refused(id, TRIGGER, sent[id]) -> goto take_back
  :: true -> goto take_back
  fi;
take_back:
  send(I_abort, 1, id, true);
  if
  :: refused(id, TRIGGER, sent[id])
  :: answered(id, TRIGGER, sent[id]) && !refused(id, TRIGGER, sent[id]) ->
    atomic { own[cmd(id, sent[id])] = false; addressed[cmd(id, sent[id])] = ALL }
#ifdef TAKE_BACK_UNHEARD /* an old fault: a start was taken back although the trigger's node had not replied */
  :: true -> send_to(ALL)
#endif
  :: true
  fi;
  goto quit;
stop:
  send(I_stop, 1, id, false);
  if
  :: answered(id, TRIGGER, sent[id])
  :: true
  fi;
  send_to(ALL);
quit:
  gone++
}

/* Second invariant: a stop is executed in the end. */
proctype LastOperator() {
  byte id = LAST;
  gone == PEOPLE;
  ending = true;
  send(I_stop, ALL, NOBODY, false);
  all_final(LAST, sent[LAST]);
  send(I_abort, ALL, NOBODY, false);
  all_final(LAST, sent[LAST])
}

init {
  byte i;
  atomic {
    fill_table();
    for (i : 0 .. NODES - 1) { run Node(i) }
    for (i : 0 .. PEOPLE - 1) { run Operator(i) }
    run LastOperator()
  }
  /* No event is left. */
  timeout -> assert(ending && all_idle)
}
