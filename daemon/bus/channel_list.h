// The channels of a studio: what may arrive, and how long a message of each kind may be.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "base/config/studio_file.h"

namespace v3d {

/// What is known of a channel by its name alone.
struct ChannelKind {
  std::string_view name;  ///< of the channel, or what the name of a node or camera follows
  enum class Of { kStudio, kNodes, kCameras } of = Of::kStudio;
  size_t max_bytes = 0;  ///< of a message, with a trailer if there is one
  /// Messages hold a MAC of their own (wire/studio_key.h), or a signature: those of one datagram
  /// need no other MAC, unless MessageSeal::cover_commands() was called.
  bool holds_own_mac = false;
  /// A person may see what cannot be verified, marked as such: a node without a key has to say so.
  bool is_shown_unverified = false;
  /// Nodes act on it: accepted only of a session that has answered a question (SessionGate).
  bool needs_answer = false;
  /// Between the receivers themselves (SessionMessage): its nonces show that it is recent.
  bool is_of_sessions = false;
  /// Which member must sign, where there is a member list (MemberSignatures).
  enum class Author : uint8_t {
    kUnsigned,             ///< frames, and what holds a signature of its own
    kAnyMember,            ///< an answer of a session
    kOwner,                ///< the node that ChannelList::owner_of() names
    kReconstructionOwner,  ///< the same, with the role reconstruction
    kNodeInside,           ///< the node that the message names
    kReconstruction        ///< every node with that role
  } author = Author::kUnsigned;

  bool is_signed() const { return author != Author::kUnsigned; }
};

/// By the form of its name; null when `channel` is none of a studio.
const ChannelKind* kind_of(std::string_view channel);

/// The exact names when the studio is known. Otherwise names of the same form, up to kMaxNames that
/// have been used. One thread.
class ChannelList {
 public:
  static constexpr size_t kMaxNames = 256;

  ChannelList() = default;
  explicit ChannelList(const Studio& studio);

  /// Null when `channel` is none of the studio's. Allocates nothing.
  const ChannelKind* find(std::string_view channel) const;
  /// The node that sends on `channel`: that which the name of the channel holds, that of the camera
  /// which it holds, the trigger's for pulses. Empty for other channels, and where only the studio
  /// file would tell and there is none.
  std::string_view owner_of(std::string_view channel) const;
  /// Whether a message may be passed on: false once too many names are in use.
  bool use(std::string_view channel);

 private:
  bool is_exact_ = false;
  /// Allowed, or in use; with their owners.
  std::map<std::string, std::string, std::less<>> names_;
};

}  // namespace v3d
