#include "wire/messages.h"

namespace v3d::wire {

std::string_view name(CommandVerb verb) {
  switch (verb) {
    case CommandVerb::kArm:
      return "arm";
    case CommandVerb::kStart:
      return "start";
    case CommandVerb::kStop:
      return "stop";
    case CommandVerb::kAbort:
      return "abort";
    case CommandVerb::kBackground:
      return "background";
    case CommandVerb::kCommit:
      return "commit";
    case CommandVerb::kCheck:
      return "check";
  }
  return "unknown";
}

std::string_view name(NodeState state) {
  switch (state) {
    case NodeState::kIdle:
      return "idle";
    case NodeState::kArmed:
      return "armed";
    case NodeState::kRecording:
      return "recording";
    case NodeState::kDraining:
      return "draining";
    case NodeState::kFault:
      return "fault";
  }
  return "unknown";
}

}  // namespace v3d::wire
