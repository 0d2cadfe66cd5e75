// Names of the LCM channels.
#pragma once

#include <string>

namespace v3d {

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

}  // namespace v3d
