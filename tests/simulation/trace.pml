/* Spin model that checks traces of the simulator against the protocol model (docs/testing.md).
 *
 * traces.h holds the events of many schedules (write_traces). Spin replays each trace on the node of node.pml, which
 * control.pml checks in all states, and on the rules of operators and pulses below. A forbidden step blocks. An event holds
 * the phase of the node after it; Spin searches for a report of the node's work that leads to this phase. A trace is accepted
 * when its last event is replayed. Traces do not hold nonces, health, the content of ledgers, or time. */
c_decl {
\#include "traces.h"
}

#define NODES 8
#define OPERATORS 32

/* Kinds of events: the values of ProtocolEvent::Kind. */
#define E_command 0
#define E_report 1
#define E_reply 2
#define E_crash 3
#define E_pulses_begin 4
#define E_pulses_end 5
#define E_send 6
#define E_receive 7

/* The present event, and the orders of the operators. Hidden, because `chosen` and `next` determine them. */
hidden byte kind, node, sender, counter, command, own, named, after, outcome, may_end, addressed;
hidden byte order_verb[OPERATORS], order_take[OPERATORS]; /* arm, start ...; the name of the take, as a number */

#define verb_of(op, c) command
#define own_of(op, c) own
#define is_about_other(op, c, t) (named != 0 && named != order_take[t])
#define input_of(op, n, c) ((command == I_start && take[n] != NOBODY && order_verb[take[n]] == I_background) -> I_learn : command)
#define last_stale(op) 0
#define on_start(n) skip
#include "node.pml"

int chosen, next, end;
byte nodes;
byte pulses = NOBODY;                 /* the take whose pulses run */
bool have_run[OPERATORS];             /* pulses of the take */

/* Replies to an operator's present command: sent by nodes, and received by operators. */
byte replied_to[NODES * OPERATORS];
byte replied[NODES * OPERATORS];      /* outcomes, as bits */
byte received[NODES * OPERATORS];
/* The commands of operators. */
byte sent[OPERATORS];
byte sent_verb[OPERATORS];
bool takes_back[OPERATORS];
bool is_wide[OPERATORS];               /* the present command goes to all nodes */

hidden byte owner, misses, o, allowed, idle_stop;

inline begin_trace() {
  c_code { load_trace(); };
  nodes = c_expr { kTraces[now.chosen].nodes };
  next = c_expr { kTraces[now.chosen].first };
  end = c_expr { kTraces[now.chosen].end }
}

/* Nodes other than the trigger's for which `what` does not hold make `allowed` false. */
#define others_must(what) \
  d_step { \
    for (o : 1 .. NODES - 1) { \
      if \
      :: o < nodes && !(what) -> allowed = false \
      :: else \
      fi \
    } \
    o = 0 \
  }

/* --- nodes --- */

/* An admitted command. A start is rejected when the trigger does not answer, an arm when it fails at once. */
inline follow_command() {
  d_step {
    if
    :: counter <= executed[at(sender, node)]
    :: else ->
      idle_stop = phase[node] == P_idle && command == I_stop;
      execute(sender, node, counter);
      if
      :: idle_stop -> reply_of[at(sender, node)] = O_none /* the ledger of the last take, if there is one */
      :: phase[node] != after && (phase[node] == P_recording || phase[node] == P_learning) && after == P_fault ->
        waits[at(sender, node)] = true; report(node, I_broken, O_refused)
      :: phase[node] != after && phase[node] == P_arming -> report(node, I_failed, O_refused)
      :: else
      fi
    fi
  };
  phase[node] == after
}

#define leads(input) (table_next[row(phase[node], input)] != phase[node])

inline choose_report() {
  if
  :: leads(I_ready) -> report(node, I_ready, O_done)
  :: leads(I_failed) -> report(node, I_failed, O_refused)
  :: leads(I_expired) -> report(node, I_expired, O_done)
  :: leads(I_train_ended) && (may_end || node == TRIGGER || take[node] != pulses) -> report(node, I_train_ended, O_done)
  :: leads(I_drained) -> report(node, I_drained, O_done)
  :: leads(I_broken) -> report(node, I_broken, O_refused)
  fi
}

/* Reports of the node's own work: one or two between two commands. */
inline follow_report() {
  if
  :: after == P_recording ->
    if
    :: phase[node] == P_idle
    :: choose_report(); phase[node] == P_idle
    fi;
    node != TRIGGER && may_rejoin[node] && kept[node] == sender && have_run[sender];
    rejoin(node)
  :: after != P_recording ->
    choose_report();
    if
    :: phase[node] == after
    :: phase[node] != after -> choose_report()
    fi
  fi;
  phase[node] == after
}

inline follow_reply() {
  counter < executed[at(sender, node)] ||
      (counter == executed[at(sender, node)] &&
       (outcome == O_pending || reply_of[at(sender, node)] == O_none || reply_of[at(sender, node)] == outcome));
  d_step { if
  :: counter > replied_to[at(sender, node)] -> replied_to[at(sender, node)] = counter; replied[at(sender, node)] = 1 << outcome
  :: counter == replied_to[at(sender, node)] -> replied[at(sender, node)] = replied[at(sender, node)] | (1 << outcome)
  :: else
  fi }
}

/* --- pulses --- */

/* Pulses begin only after every node records the take. */
inline follow_pulses_begin() {
  pulses == NOBODY && (phase[TRIGGER] == P_recording || phase[TRIGGER] == P_learning) && take[TRIGGER] == sender;
  allowed = true;
  others_must(records[o] == sender);
  allowed;
  pulses = sender; have_run[sender] = true
}

/* --- operators: StudioCoordinator --- */

#define all_have_replied_done \
  allowed = received[at(sender, TRIGGER)] == O_done; \
  others_must(received[at(sender, o)] == O_done)

/* Starts the next command. */
inline begin_command() {
  allowed = true;
  if
  :: sent[sender] == 0 -> allowed = (command == order_verb[sender] && !own)
  :: sent[sender] != 0 && own -> allowed = (command == I_abort && !takes_back[sender]); takes_back[sender] = true
  :: sent[sender] != 0 && !own && command == I_commit -> all_have_replied_done; allowed = allowed && is_order(order_verb[sender])
  :: sent[sender] != 0 && !own && command == I_start ->
    all_have_replied_done; allowed = allowed && order_verb[sender] == I_background && sent_verb[sender] == I_commit
  :: sent[sender] != 0 && !own && command == I_stop ->
    all_have_replied_done; allowed = allowed && order_verb[sender] == I_background && sent_verb[sender] == I_start
  :: sent[sender] != 0 && !own && command != I_commit && command != I_start && command != I_stop -> allowed = false
  fi;
  allowed;
  sent[sender] = counter; sent_verb[sender] = command; is_wide[sender] = false;
  d_step {
    for (o : 0 .. NODES - 1) {
      received[at(sender, o)] = O_none
    }
    o = 0
  }
}

#define trigger_has_accepted (received[at(sender, TRIGGER)] == O_pending || received[at(sender, TRIGGER)] == O_done)

/* Nodes that a command may be sent to. */
inline check_addressed() {
  allowed = true;
  if
  :: command == I_start && (addressed & 1) -> others_must(received[at(sender, o)] == O_done)
  :: is_order(command) && addressed > 1 -> allowed = (is_wide[sender] || trigger_has_accepted); is_wide[sender] = true
  :: command == I_abort && takes_back[sender] && !own -> allowed = (order_verb[sender] == I_start && trigger_has_accepted)
  :: else
  fi;
  allowed
}

inline follow_send() {
  if
  :: counter == sent[sender] + 1 -> begin_command()
  :: counter == sent[sender] && command == sent_verb[sender]
  fi;
  check_addressed()
}

/* Receives a reply to the present command. A node must have sent it. */
inline follow_receive() {
  counter == sent[sender] && replied_to[at(sender, node)] == counter && ((replied[at(sender, node)] >> outcome) & 1);
  if
  :: received[at(sender, node)] == O_none || received[at(sender, node)] == O_pending -> received[at(sender, node)] = outcome
  :: else
  fi
}

/* Pulses run only while the trigger's node records. */
#define pulses_are_in_place \
  (pulses == NOBODY || kind == E_pulses_end || \
   (take[TRIGGER] == pulses && (phase[TRIGGER] == P_recording || phase[TRIGGER] == P_learning)))

inline follow() {
  c_code { load_event(); };
  pulses_are_in_place;
  if
  :: kind == E_command -> follow_command()
  :: kind == E_report -> follow_report()
  :: kind == E_reply -> follow_reply()
  :: kind == E_crash -> crash(node)
  :: kind == E_pulses_begin -> follow_pulses_begin()
  :: kind == E_pulses_end -> pulses != NOBODY; pulses = NOBODY
  :: kind == E_send -> follow_send()
  :: kind == E_receive -> follow_receive()
  fi;
  next++
}

c_code {
  static int furthest[kTraceCount];  /* index of the event that blocks, or one past the last */

  static void load_trace(void) {
    const struct Trace* const trace = &kTraces[now.chosen];
    for (int i = 0; i < trace->runs; ++i) {
      order_verb[i] = kRuns[trace->first_run + i].verb;
      order_take[i] = kRuns[trace->first_run + i].take;
    }
  }
  static void load_event(void) {
    const struct Event* const event = &kEvents[now.next];
    if (now.next > furthest[now.chosen]) furthest[now.chosen] = now.next;
    kind = event->kind; node = event->node; sender = event->run; counter = event->counter;
    command = event->command; own = event->own; named = event->take; after = event->phase;
    outcome = event->outcome; may_end = event->may_end; addressed = event->addressed;
  }
  static void report_traces(void) {
    for (int i = 0; i < kTraceCount; ++i) {
      if (furthest[i] == kTraces[i].end) {
        printf("accepted: trace %llu\n", kTraces[i].seed);
      } else {
        printf("rejected: trace %llu, event %d: %s\n", kTraces[i].seed, furthest[i] - kTraces[i].first,
               kTexts[furthest[i]]);
      }
    }
  }
};

init {
  c_code { atexit(report_traces); };
  atomic {
    d_step { fill_table() };
    do
    :: chosen + 1 < c_expr { kTraceCount } -> chosen++
    :: break
    od;
    begin_trace()
  }
  do
  :: next < end -> atomic { follow() }
  :: next == end -> c_code { furthest[now.chosen] = now.next; }; break
  od
}
