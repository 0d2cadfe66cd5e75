// What travels between the daemons and the tools, as plain values. The codec turns them into LCM
// messages.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "base/image/frame.h"

namespace v3d {

/// V3D_PULSE: one pulse, as the sense line saw it.
struct PulseMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  int64_t pulse = 0;
  RealtimeInstant edge;             ///< the rising edge, on the trigger node's CLOCK_REALTIME
  MonotonicInstant edge_monotonic;  ///< the same edge on its CLOCK_MONOTONIC, as the sensor gave it
};

/// V3D_FRAME_<camera>, and the events of <camera>.lcmlog.
struct FrameMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  Frame frame;
};

/// V3D_MESH: a compact frame (recon/pipeline/compact_frame.h) with what must be known without
/// decoding it.
struct MeshMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  int64_t pulse = 0;
  RealtimeInstant pulse_edge;        ///< for the latency from pulse to mesh; 0 when unknown
  double silhouette_iou = 0;         ///< of its quality (recon/metrics/frame_quality.h)
  double coverage = 0;               ///< the same
  int cameras = 0;                   ///< that took part
  std::vector<std::string> missing;  ///< cameras the frame set went without
  std::vector<uint8_t> compact;
};

/// V3D_MESH_<node>: what one of several reconstruction nodes made, before all are put in order.
struct ShardMeshMessage : MeshMessage {
  std::string node;
};

/// V3D_SHARD_<node>: where one of several reconstruction nodes stands. -1: no pulse.
struct ShardMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  std::string node;
  int64_t first = -1;             ///< answers for its share from this pulse on; -1: not yet
  int64_t done = -1;              ///< its share is made or given up as far as this
  int64_t ordered = -1;           ///< its stream has come as far as this
  int64_t shown = -1;             ///< the newest that it knows of on V3D_MESH
  std::vector<int64_t> given_up;  ///< of its share, without a mesh for good; the last ones
};

enum class CommandVerb : uint8_t { kArm = 1, kStart, kStop, kAbort, kBackground, kCommit, kCheck };
/// Makes the nodes ready for pulses: a take's, or others.
constexpr bool is_order(CommandVerb verb) {
  return verb == CommandVerb::kArm || verb == CommandVerb::kBackground ||
         verb == CommandVerb::kCheck;
}
std::string_view name(CommandVerb verb);

/// V3D_COMMAND. Idempotent: the same (sender, counter) is answered again, not carried out again. A
/// node obeys a command that holds a nonce which this node has published lately (CommandGate).
struct CommandMessage {
  RealtimeInstant sent;
  std::string sender;   ///< unique per run of the tool that sends
  int64_t counter = 0;  ///< counts the commands of this sender; the same in every retry
  CommandVerb verb = CommandVerb::kArm;
  bool own_only = false;  ///< abort: only what this sender has begun
  std::string take;
  double rate_hz = 0;                      ///< arm: 0 = as the studio file says
  int64_t pulses = 0;                      ///< arm: number of pulses; 0 = until stopped
  std::vector<std::string> allow_missing;  ///< arm: cameras the take may go without
  std::vector<std::string> to;             ///< the nodes that are meant
  std::vector<int64_t> nonces = {};        ///< one for each of `to`; 0: none is known
};

/// V3D_REPLY: what one node says to one command. A node may answer several times (pending, then
/// final).
struct ReplyMessage {
  RealtimeInstant sent;
  std::string node;
  std::string command_sender;
  int64_t command_counter = 0;
  RealtimeInstant command_sent;  ///< CommandMessage::sent of the command that is answered
  int64_t nonce = 0;             ///< of the node, for the next command to it
  /// kNonceMissing: nothing was done; the same command is obeyed with `nonce`.
  enum class Outcome : uint8_t {
    kPending = 1,
    kDone,
    kRefused,
    kNonceMissing
  } outcome = Outcome::kPending;
  std::string take;    ///< that the node is at, or was at last
  std::string text;    ///< one line for the operator
  std::string detail;  ///< JSON: the node's ledger after a stop, else empty
};

/// V3D_SESSION: a receiver asks a session, one sending socket, whether it lives (SessionGate).
struct SessionMessage {
  RealtimeInstant sent;
  uint32_t session = 0;  ///< that is asked, or answers
  uint32_t newest = 0;   ///< of an answer: the sequence number of its last message
  int64_t nonce = 0;     ///< of the question; not 0
  bool is_answer = false;
};

/// The small pictures on V3D_PREVIEW_<camera> are not larger than this along a side.
inline constexpr int kMaxPreviewSide = 4096;

/// V3D_PREVIEW_<camera>, about once a second while pulses run: a small picture for people.
struct PreviewMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string camera;
  int64_t pulse = -1;
  ImageSize size;             ///< of the small picture
  std::optional<Mask> mask;   ///< of that size
  std::vector<uint8_t> jpeg;  ///< base/image/jpeg.h reads it; not looked into by the codec
};

enum class NodeState : uint8_t { kIdle = 1, kArmed, kRecording, kDraining, kFault };
std::string_view name(NodeState state);

/// V3D_HEALTH_<node>, once a second and when the state changes.
struct HealthMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string node;
  std::string program;  ///< "v3d-captured", "v3d-recond"
  std::string version;  ///< of the program
  NodeState state = NodeState::kIdle;
  std::string take;
  std::string text;  ///< one line: what is wrong, else empty
  /// Counters and gauges by name, units in the name: "frames_received", "latency_p50_ms",
  /// "cam03.frames_missing", "disk_free_bytes". v3dctl(1) lists them.
  std::map<std::string, double> values;
};

enum class Severity : uint8_t { kInfo = 1, kWarning, kAlarm };

/// V3D_EVENT: something an operator may want to know now.
struct EventMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string node;
  Severity severity = Severity::kInfo;
  std::string subject;  ///< "cam07", "trigger", "disk"
  std::string text;     ///< one line
};

}  // namespace v3d
