// The channels of a studio: what may arrive, and how long a message of each kind may be.
#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <string_view>

#include "base/studio_file.h"

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
};

/// The exact names when the studio is known. Otherwise names of the same form, up to kMaxNames that
/// have been used. One thread.
class ChannelList {
 public:
  static constexpr size_t kMaxNames = 256;

  ChannelList() = default;
  explicit ChannelList(const Studio& studio);

  /// Null when `channel` is none of the studio's. Allocates nothing.
  const ChannelKind* find(std::string_view channel) const;
  /// Whether a message may be passed on: false once too many names are in use.
  bool use(std::string_view channel);

 private:
  bool is_exact_ = false;
  std::set<std::string, std::less<>> names_;  ///< allowed, or in use
};

}  // namespace v3d
