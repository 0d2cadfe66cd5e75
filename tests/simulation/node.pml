/* One node of the control protocol: how Controller (daemon/control/control.h) handles commands and reports of the node's work.
 * control.pml, rejoin.pml and trace.pml include this file. They define NODES and OPERATORS; verb_of, own_of, is_about_other
 * and input_of for command `c` of operator `op`; last_stale(op); and on_start(n), which checks a start. A proctype that uses
 * the inlines declares owner, misses and o. */
#include "transitions.pml"

#define TRIGGER 0
#define NOBODY 255

#define O_none 0
#define O_pending 1
#define O_done 2
#define O_refused 3

/* The number of a take is that of the operator who arms it. */
byte phase[NODES];
byte take[NODES] = NOBODY;
byte starter[NODES] = NOBODY;
byte kept[NODES] = NOBODY;    /* on the disk: the last take that was armed */
bool may_rejoin[NODES];
byte records[NODES] = NOBODY; /* the last take whose start was executed; survives crashes */
#define at(op, node) ((op) * NODES + (node))
byte executed[NODES * OPERATORS];  /* by operator and node: the last executed command */
byte reply_of[NODES * OPERATORS];  /* by operator and node: the reply to that command */
bool waits[NODES * OPERATORS];     /* by operator and node: the operator waits for a final reply */
hidden byte next_phase, work, verdict;

#define is_order(verb) ((verb) == I_arm || (verb) == I_check || (verb) == I_background)

inline finish(n, outcome) {
  d_step {
    for (o : 0 .. OPERATORS - 1) {
      if
      :: waits[at(o, n)] -> reply_of[at(o, n)] = outcome; waits[at(o, n)] = false
      :: else
      fi
    }
    o = 0
  }
}

/* Controller::mismatch() */
inline judge(op, n, c) {
  misses = false;
  if
  :: !is_order(verb_of(op, c)) && phase[n] != P_idle && phase[n] != P_fault ->
    owner = (phase[n] > P_armed -> starter[n] : take[n]);
    misses = is_about_other(op, c, take[n]) ||
             ((verb_of(op, c) == I_commit || (own_of(op, c) && phase[n] != P_armed)) && op != owner);
    owner = 0
  :: else
  fi
}

/* Controller::execute() */
inline execute(op, n, c) {
  executed[at(op, n)] = c;
  judge(op, n, c);
  if
  :: misses -> reply_of[at(op, n)] = O_refused
  :: else ->
    lookup(phase[n], input_of(op, n, c));
    if
    :: work == W_arm -> take[n] = op; kept[n] = op; may_rejoin[n] = false
    :: work == W_learn -> take[n] = op; kept[n] = NOBODY; may_rejoin[n] = false
    :: work == W_start -> starter[n] = op; records[n] = take[n]; on_start(n)
    :: else
    fi;
    phase[n] = next_phase;
    reply_of[at(op, n)] = (verdict == V_done -> O_done : (verdict == V_pending -> O_pending : O_refused));
    if
    :: verdict == V_done && verb_of(op, c) == I_abort -> finish(n, O_refused); reply_of[at(op, n)] = O_done
    :: verdict == V_pending -> waits[at(op, n)] = true
    :: else
    fi
  fi;
  misses = false
}

/* Controller::on_event() */
inline report(n, input, outcome) {
  lookup(phase[n], input);
  if
  :: next_phase != phase[n] && input != I_train_ended -> finish(n, outcome)
  :: else
  fi;
  phase[n] = next_phase
}

/* The node rejoins the take that it recorded before its crash. */
inline rejoin(n) {
  may_rejoin[n] = false;
  report(n, I_rejoined, O_done);
  take[n] = kept[n]; starter[n] = kept[n]
}

/* A crash: all memory is lost. Commands of an operator up to last_stale(op) are rejected from then on. */
inline crash(n) {
  phase[n] = P_idle; may_rejoin[n] = (kept[n] != NOBODY);
  d_step {
    for (o : 0 .. OPERATORS - 1) {
      executed[at(o, n)] = last_stale(o); reply_of[at(o, n)] = O_none; waits[at(o, n)] = false
    }
    o = 0
  }
}
