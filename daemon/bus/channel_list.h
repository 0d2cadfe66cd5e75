// Channels, frame groups, and sizes of messages.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/bus/datagram.h"

namespace v3d::bus {

// The channels of a studio: their names, size limits and rules of authentication.

/// The properties of a channel that follow from its name alone.
struct ChannelKind {
  std::string_view name;  ///< of the channel, or the prefix before the name of a node or camera
  enum class Of { kStudio, kNodes, kCameras } of = Of::kStudio;
  size_t max_bytes = 0;  ///< of a message, including a trailer if there is one
  /// Commands and replies: they contain their own MAC (wire/secret_keys.h) or signature, which the
  /// subscriber verifies (Credentials). Their datagrams carry a MAC like all others.
  bool holds_own_mac = false;
  /// Unverified messages are delivered too, marked as such: an operator must see the health of a
  /// node that has no key.
  bool is_shown_unverified = false;
  /// Accepted only from a session that has responded to a challenge (SessionReplayFilter), because
  /// nodes act on the message.
  bool needs_challenge = false;
  /// SessionMessage, which receivers exchange. Its nonces prove that it is recent.
  bool is_of_sessions = false;
  /// Live frames. When members are required, they carry the MAC of a frame key (FrameSessions)
  /// instead of that of the studio key, and no signature.
  bool is_of_frames = false;
  /// FrameKeyMessage, which a receiver handles itself when members are required.
  bool is_of_frame_keys = false;
  /// The member that must sign when there is a member list (MemberSignatures).
  enum class Author : uint8_t {
    kUnsigned,             ///< frames, and messages that contain their own signature
    kAnyMember,            ///< a response of a session
    kOwner,                ///< the node that ChannelList::owner_of() names
    kReconstructionOwner,  ///< the same, with the role reconstruction
    kNodeInside,           ///< the node that the message names
    kReconstruction        ///< every node with that role
  } author = Author::kUnsigned;

  bool is_signed() const { return author != Author::kUnsigned; }
};

/// Finds the kind by the form of the name; null when `channel` is no channel of a studio.
const ChannelKind* kind_of(std::string_view channel);

/// The set of permitted channels. With a studio file: exactly its channels. Without one: all names
/// of the same form, up to kMaxNames of them in use. One thread.
class ChannelList {
 public:
  static constexpr size_t kMaxNames = 256;

  ChannelList() = default;
  explicit ChannelList(const Studio& studio);

  /// Null when `channel` is not permitted. Allocates nothing.
  const ChannelKind* find(std::string_view channel) const;
  /// The node that sends on `channel`: the node in its name, the node of the camera in its name, or
  /// the trigger's node for pulses. Empty for other channels, and without a studio file for
  /// channels of cameras and pulses.
  std::string_view owner_of(std::string_view channel) const;
  /// Marks the channel as used. Returns false, and the message must be dropped, when kMaxNames
  /// other names are in use or a studio file does not have the channel.
  bool use(std::string_view channel);

 private:
  bool is_exact_ = false;
  /// Channel names, permitted or in use, with their owners.
  std::map<std::string, std::string, std::less<>> names_;
};

// Distribution of live frames over several multicast groups by pulse ([network] frame_groups), so
// that a node receives only the frames of pulses that it reconstructs.

/// Assigns sequence numbers to the live frames of one camera.
///
/// Every group has its own numbers, so that a receiver of some groups sees no gaps. The sequence
/// numbers of group g of n are g, g + n, g + 2 n and so on.
class FrameNumbers {
 public:
  explicit FrameNumbers(size_t groups) : next_(groups) {}

  /// The sequence number of the next frame, which shows `pulse`. A negative pulse counts as 0.
  int64_t next(int64_t pulse) {
    const size_t group = group_of(pulse, next_.size());
    return next_[group]++ * std::ssize(next_) + static_cast<int64_t>(group);
  }

  /// The index of the group that carries frames of `pulse`, below `groups`.
  static size_t group_of(int64_t pulse, size_t groups) {
    return static_cast<size_t>(std::max<int64_t>(pulse, 0)) % groups;
  }

 private:
  std::vector<int64_t> next_;
};

/// Indices of groups, each below the number of groups.
using FrameGroupSet = std::set<size_t>;

inline FrameGroupSet all_frame_groups(size_t groups) {
  FrameGroupSet all;
  for (size_t group = 0; group < groups; ++group) all.insert(all.end(), group);
  return all;
}

// Sizes of messages. A sender shortens what its receivers would drop.

/// The longest health, in bytes, that receivers accept without verification: a stranger determines
/// how much memory it needs.
inline constexpr size_t kMaxUnverifiedHealth = size_t{32} << 10;

/// Whether the message of this first datagram is delivered although it is not authentic.
bool is_shown_unverified(const Datagram& first, const ChannelKind& kind);

/// The longest encoded message, in bytes, that receivers accept on `channel`: its limit without
/// trailer and signature. `has_key`: the sender has the studio key. Without it, receivers cannot
/// verify the message. kMaxMessage for a name that is no channel of a studio.
size_t max_encoded_bytes(std::string_view channel, bool has_key);

/// `text`, or its beginning with " ..." at the end, at most `max_bytes` long. Cuts between two
/// characters of UTF-8. `max_bytes` is at least 4.
std::string shortened(const std::string& text, size_t max_bytes);

}  // namespace v3d::bus
