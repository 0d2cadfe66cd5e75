// Program that runs schedules and writes their events as C tables for trace.pml. With a mutation,
// it writes only the traces to which the mutation applies.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "simulation/schedule.h"

namespace v3d::simulation {
namespace {

using Kind = ProtocolEvent::Kind;
using Events = std::vector<ProtocolEvent>;
using Place = Events::iterator;

/// Changes a trace into a forbidden one. Returns false when it does not apply to the trace.
using Mutation = std::function<bool(Events& events)>;

bool is_obeyed_start(const ProtocolEvent& event) {
  return event.kind == Kind::kCommand && event.command == control::Input::kStart &&
         event.phase == control::Phase::kRecording;
}

/// Lets the pulses begin before the last of the other nodes records.
bool begin_pulses_early(Events& events) {
  const auto pulses = std::ranges::find(events, Kind::kPulsesBegin, &ProtocolEvent::kind);
  const auto start =
      std::find_if(std::make_reverse_iterator(pulses), events.rend(),
                   [](const auto& event) { return is_obeyed_start(event) && event.node != 0; });
  if (pulses == events.end() || start == events.rend()) return false;
  std::rotate(std::prev(start.base()), pulses, std::next(pulses));
  return true;
}

/// Removes the stop of a node that drains.
bool drop_obeyed_stop(Events& events) {
  std::map<int, control::Phase> before;
  for (auto event = events.begin(); event != events.end(); ++event) {
    const bool stops = event->kind == Kind::kCommand && event->command == control::Input::kStop;
    if (stops && before[event->node] == control::Phase::kRecording &&
        event->phase == control::Phase::kDraining) {
      events.erase(event);
      return true;
    }
    if (event->kind == Kind::kCommand || event->kind == Kind::kReport)
      before[event->node] = event->phase;
    if (event->kind == Kind::kCrash) before[event->node] = control::Phase::kIdle;
  }
  return false;
}

/// Removes a reply of another node, so that the operator starts the trigger's node too early.
bool start_trigger_before_replies(Events& events) {
  const auto send = std::ranges::find_if(events, [](const ProtocolEvent& event) {
    return event.kind == Kind::kSend && event.command == control::Input::kStart &&
           event.addressed == 1;
  });
  if (send == events.end()) return false;
  const auto reply =
      std::find_if(std::make_reverse_iterator(send), events.rend(), [&](const auto& event) {
        return event.kind == Kind::kReceive && event.run == send->run && event.node != 0;
      });
  if (reply == events.rend()) return false;
  events.erase(std::prev(reply.base()));
  return true;
}

/// Lets the pulses continue after the trigger's node has crashed.
bool keep_pulses_after_crash(Events& events) {
  const auto end =
      std::ranges::adjacent_find(events, [](const ProtocolEvent& a, const ProtocolEvent& b) {
        return a.kind == Kind::kCrash && b.kind == Kind::kPulsesEnd;
      });
  if (end == events.end()) return false;
  events.erase(std::next(end));
  return true;
}

const std::map<std::string, Mutation> kMutations = {
    {"none", [](Events&) { return true; }},
    {"begin_pulses_early", begin_pulses_early},
    {"drop_obeyed_stop", drop_obeyed_stop},
    {"start_trigger_before_replies", start_trigger_before_replies},
    {"keep_pulses_after_crash", keep_pulses_after_crash},
};

struct SeededTrace {
  uint64_t seed = 0;
  ProtocolTrace trace;
};

void write_runs(const std::vector<SeededTrace>& traces) {
  std::puts("static const struct Run { unsigned char verb, take; } kRuns[] = {");
  for (const auto& [seed, trace] : traces) {
    for (const auto& run : trace.runs)
      std::printf("{%d,%d},\n", static_cast<int>(run.order), run.take);
  }
  std::puts("};");
}

void write_events(const std::vector<SeededTrace>& traces) {
  std::puts(
      "static const struct Event { unsigned char kind, node, run, counter, command, own, take, "
      "phase, "
      "outcome, may_end, addressed; } kEvents[] = {");
  for (const auto& [seed, trace] : traces) {
    for (const ProtocolEvent& e : trace.events) {
      std::printf("{%d,%d,%d,%d,%d,%d,%d,%d,%d,%d,%u},\n", static_cast<int>(e.kind), e.node, e.run,
                  static_cast<int>(e.counter), static_cast<int>(e.command), e.own_only ? 1 : 0,
                  e.take, static_cast<int>(e.phase), e.outcome, e.may_end ? 1 : 0, e.addressed);
    }
  }
  std::puts("};\nstatic const char* const kTexts[] = {");
  for (const auto& [seed, trace] : traces) {
    for (const ProtocolEvent& event : trace.events)
      std::printf("\"%s\",\n", text_of(event).c_str());
  }
  std::puts("};");
}

void write_traces(const std::vector<SeededTrace>& traces) {
  std::printf("#define kTraceCount %zu\n", traces.size());
  std::puts(
      "static const struct Trace { unsigned long long seed; int nodes, runs, first_run, first, "
      "end; } "
      "kTraces[] = {");
  size_t run = 0, event = 0;
  for (const auto& [seed, trace] : traces) {
    std::printf("{%lluULL,%d,%zu,%zu,%zu,%zu},\n", static_cast<unsigned long long>(seed),
                trace.nodes, trace.runs.size(), run, event, event + trace.events.size());
    run += trace.runs.size();
    event += trace.events.size();
  }
  std::puts("};");
}

/// False where nothing was written.
bool write(uint64_t first, uint64_t count, const Mutation& mutate) {
  std::vector<SeededTrace> traces;
  // The model has no ledger that cannot be written, so such schedules are left out.
  for (uint64_t seed = first, left = count; left > 0; ++seed) {
    const Outcome outcome = play_schedule(seed, false);
    if (outcome.loses_ledgers) continue;
    --left;
    ProtocolTrace trace = outcome.events;
    if (mutate(trace.events)) traces.push_back({seed, std::move(trace)});
  }
  if (traces.empty()) return false;
  write_traces(traces);
  write_runs(traces);
  write_events(traces);
  return true;
}

}  // namespace
}  // namespace v3d::simulation

int main(int argc, char** argv) {
  using namespace v3d::simulation;
  spdlog::set_level(spdlog::level::off);
  const auto mutation = argc == 4 ? kMutations.find(argv[3]) : kMutations.end();
  if (mutation == kMutations.end()) {
    std::fputs("usage: write_traces FIRST_SEED COUNT MUTATION\n", stderr);
    return 2;
  }
  const uint64_t first = std::strtoull(argv[1], nullptr, 10);
  return write(first, std::strtoull(argv[2], nullptr, 10), mutation->second) ? 0 : 1;
}
