// Messages and the channels they travel on.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/core/time.h"
#include "base/image/frame.h"

namespace v3d::wire {

// Messages between the daemons and the tools, as plain values. The codec (wire/codec.h) converts
// them to LCM messages.

/// V3D_PULSE: one pulse that the sense line detected.
struct PulseMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  int64_t pulse = 0;
  RealtimeInstant edge;             ///< the rising edge, on the trigger node's CLOCK_REALTIME
  MonotonicInstant edge_monotonic;  ///< the same edge on its CLOCK_MONOTONIC, from the sensor
};

/// V3D_FRAME_<camera>, and the events of <camera>.lcmlog.
struct FrameMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  Frame frame;
};

/// V3D_MESH: a compact frame (recon/pipeline/compact_frame.h), with the values that receivers need
/// without decoding it.
struct MeshMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  int64_t pulse = 0;
  RealtimeInstant pulse_edge;  ///< rising edge of the pulse, to compute the latency; 0 when unknown
  double silhouette_iou = 0;   ///< 0 to 1 (recon/metrics/frame_quality.h)
  double coverage = 0;         ///< 0 to 1, from the same header
  int cameras = 0;             ///< number of cameras that took part
  std::vector<std::string> missing;  ///< cameras whose frames the frame set lacks
  std::vector<uint8_t> compact;
};

/// V3D_MESH_<node>: a mesh of one of several reconstruction nodes, before the meshes of all nodes
/// are put in order.
struct ShardMeshMessage : MeshMessage {
  std::string node;
};

/// V3D_SHARD_<node>: progress of one of several reconstruction nodes. All fields are pulse numbers;
/// -1: no pulse.
struct ShardMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string take;
  std::string node;
  int64_t first = -1;    ///< the node is responsible for its share from this pulse on; -1: not yet
  int64_t done = -1;     ///< its share is complete up to this pulse: every mesh is made or given up
  int64_t ordered = -1;  ///< its ordered stream has reached this pulse
  int64_t shown = -1;    ///< newest pulse on V3D_MESH that it published or that was reported to it
  std::vector<int64_t>
      given_up;  ///< pulses of its share that will get no mesh; the most recent ones
};

enum class CommandVerb : uint8_t { kArm = 1, kStart, kStop, kAbort, kBackground, kCommit, kCheck };
/// True for verbs that prepare nodes for pulses, of a take or of another kind.
constexpr bool is_order(CommandVerb verb) {
  return verb == CommandVerb::kArm || verb == CommandVerb::kBackground ||
         verb == CommandVerb::kCheck;
}
std::string_view name(CommandVerb verb);

/// V3D_COMMAND. Idempotent: when a node receives the same (sender, counter) again, it repeats its
/// reply and does not repeat the action. A node executes a command only if it holds a nonce that
/// this node published recently (CommandReplayFilter).
struct CommandMessage {
  RealtimeInstant sent;
  std::string sender;   ///< unique for each run of the sending tool
  int64_t counter = 0;  ///< number of the command from this sender; a retry has the same
  CommandVerb verb = CommandVerb::kArm;
  bool own_only = false;  ///< abort: only orders of this sender
  std::string take;
  double rate_hz = 0;                      ///< arm: Hz; 0 = the rate of the studio file
  int64_t pulses = 0;                      ///< arm: number of pulses; 0 = until stopped
  std::vector<std::string> allow_missing;  ///< arm: cameras that may be missing in the take
  std::vector<std::string> to;             ///< the addressed nodes
  std::vector<int64_t> nonces = {};        ///< one for each node of `to`; 0: unknown
};

/// V3D_REPLY: the reply of one node to one command. A node may reply several times (pending, then
/// final).
struct ReplyMessage {
  RealtimeInstant sent;
  std::string node;
  std::string command_sender;
  int64_t command_counter = 0;
  RealtimeInstant command_sent;  ///< CommandMessage::sent of that command
  int64_t nonce = 0;             ///< of the node, for the next command to this node
  /// kNonceMissing: the node did nothing; it executes the same command with `nonce`.
  enum class Outcome : uint8_t {
    kPending = 1,
    kDone,
    kRefused,
    kNonceMissing
  } outcome = Outcome::kPending;
  std::string take;    ///< current or last take of the node
  std::string text;    ///< one line for the operator
  std::string detail;  ///< JSON: the ledger of the node after a stop, else empty
};

/// V3D_SESSION: a receiver challenges a session, that is one sending socket, to prove that it is
/// alive; the session responds (SessionReplayFilter).
struct SessionMessage {
  RealtimeInstant sent;
  uint32_t session = 0;    ///< the session that is challenged or responds
  uint32_t newest = 0;     ///< in a response: the sequence number of its last message
  int64_t nonce = 0;       ///< random number of the challenge, not 0; the response repeats it
  bool is_answer = false;  ///< true: a response; false: a challenge
};

/// A frame key that only one recipient can open (wire/datagram_mac.h).
struct SealedFrameKey {
  std::array<uint8_t, 8> recipient{};  ///< the first bytes of its public key (KeyId)
  std::array<uint8_t, 80> sealed{};
};
/// Maximum number of recipients of a frame key.
inline constexpr size_t kMaxFrameKeyRecipients = 64;

/// V3D_FRAMEKEY_<node>, once a second: the frame key of the node, for the reconstruction nodes.
struct FrameKeyMessage {
  RealtimeInstant sent;
  uint32_t session = 0;              ///< of the live frames (trailers of their datagrams)
  uint32_t newest = 0;               ///< the sequence number of the last message of that session
  std::vector<SealedFrameKey> keys;  ///< at most kMaxFrameKeyRecipients
};

/// Maximum width and height of the images on V3D_PREVIEW_<camera>, pixels.
inline constexpr int kMaxPreviewSide = 4096;

/// V3D_PREVIEW_<camera>, about once a second while pulses run: a small image for operators.
struct PreviewMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string camera;
  int64_t pulse = -1;
  ImageSize size;             ///< size of the small image, pixels
  std::optional<Mask> mask;   ///< same size as the image
  std::vector<uint8_t> jpeg;  ///< base/image/image_files.h decodes it; the codec does not check it
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
  std::string text;  ///< one line: the problem, else empty
  /// Counters and gauges by name, with the unit in the name: "frames_received", "latency_p50_ms",
  /// "cam03.frames_missing", "disk_free_bytes". v3dctl(1) lists them.
  std::map<std::string, double> values;
  /// Texts by name, one line each: "cam03.model", "cam03.firmware". v3dctl(1) lists them.
  std::map<std::string, std::string> texts = {};
};

/// The parts of a name in HealthMessage: "cam03.firmware". Names of cameras may have dots, those of
/// values have none.
struct HealthName {
  std::string camera;  ///< empty: a value of the node
  std::string name;
};
inline HealthName split_health_name(const std::string& text) {
  const size_t dot = text.rfind('.');
  if (dot == std::string::npos) return {.camera = {}, .name = text};
  return {.camera = text.substr(0, dot), .name = text.substr(dot + 1)};
}

enum class Severity : uint8_t { kInfo = 1, kWarning, kAlarm };

/// V3D_EVENT: a message for the operator about something that happened.
struct EventMessage {
  RealtimeInstant sent;
  int64_t seq = 0;
  std::string node;
  Severity severity = Severity::kInfo;
  std::string subject;  ///< source of the event: "cam07", "trigger", "disk"
  std::string text;     ///< one line
};

// Names of the LCM channels.

inline constexpr char kCommandChannel[] = "V3D_COMMAND";
inline constexpr char kReplyChannel[] = "V3D_REPLY";
inline constexpr char kPulseChannel[] = "V3D_PULSE";
inline constexpr char kMeshChannel[] = "V3D_MESH";
inline constexpr char kEventChannel[] = "V3D_EVENT";
inline constexpr char kSessionChannel[] = "V3D_SESSION";
/// Prefixes: the name of the camera or of the node follows.
inline constexpr char kFramePrefix[] = "V3D_FRAME_";
/// Does not begin with kFramePrefix, so that a subscription to all frames does not include it.
inline constexpr char kFrameKeyPrefix[] = "V3D_FRAMEKEY_";
inline constexpr char kHealthPrefix[] = "V3D_HEALTH_";
inline constexpr char kPreviewPrefix[] = "V3D_PREVIEW_";
inline constexpr char kShardPrefix[] = "V3D_SHARD_";
inline constexpr char kShardMeshPrefix[] = "V3D_MESH_";

inline std::string frame_channel(const std::string& camera) { return kFramePrefix + camera; }
inline std::string frame_key_channel(const std::string& node) { return kFrameKeyPrefix + node; }
inline std::string health_channel(const std::string& node) { return kHealthPrefix + node; }
inline std::string preview_channel(const std::string& camera) { return kPreviewPrefix + camera; }
inline std::string shard_channel(const std::string& node) { return kShardPrefix + node; }
inline std::string shard_mesh_channel(const std::string& node) { return kShardMeshPrefix + node; }

}  // namespace v3d::wire
