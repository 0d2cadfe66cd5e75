// Frame keys, sent and received.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "daemon/bus/credentials.h"
#include "daemon/bus/multicast_socket.h"
#include "wire/datagram_mac.h"
#include "wire/member_list.h"
#include "wire/messages.h"
#include "wire/signatures.h"

namespace v3d::bus {

// The frame key with which this process sends its live frames, and its announcement.

/// Draws a frame key and a session for the live frames of this process, and a new pair when the
/// keys of the reconstruction nodes in the member list change. A revoked node therefore can neither
/// forge nor verify later frames.
///
/// A new key is announced at once and used from kSendOld later, so that receivers have it before
/// the first frame. They accept the previous key for kAcceptOld. Any thread.
class OwnFrameKey {
 public:
  struct Sending {
    explicit Sending(wire::DatagramMac frame_mac) : mac(std::move(frame_mac)) {}
    const wire::DatagramMac mac;
    SendingSession session;
  };
  using Rotation = KeyRotation<std::shared_ptr<Sending>, 1>;
  static constexpr Duration kAcceptOld = Rotation::kAcceptOld;

  /// Draws a key for the reconstruction nodes of this list, unless the key is for these already. Of
  /// more than kMaxFrameKeyRecipients keys, the others get none; returns false then.
  bool adapt_to(const wire::MemberList& members, MonotonicInstant now);
  /// The message with the newest key, without a time. Requires adapt_to().
  wire::FrameKeyMessage announcement() const;
  /// MAC and session for the next frame; null before adapt_to().
  std::shared_ptr<Sending> sending(MonotonicInstant now) const;

 private:
  mutable std::mutex mutex_;  ///< guards the members below
  std::vector<wire::PublicKey> recipients_;
  std::vector<wire::SealedFrameKey> sealed_;  ///< the newest key
  Rotation keys_;
};

// Frame sessions: the sockets from which the nodes of a studio with a member list send their live
// frames, with the keys that verify them.

/// One frame session, as its node announced it.
struct FrameSession {
  uint32_t number = 0;  ///< in the trailers of its datagrams
  /// Differs for each accepted pair of node and number. Another node may announce the same number;
  /// its datagrams have another key and another id.
  uint32_t id = 0;
  std::string node;
  wire::KeyId signer{};                          ///< of the node's last announcement
  std::shared_ptr<const wire::DatagramMac> mac;  ///< null: the key was not sealed for this process
  MonotonicInstant announced;                    ///< time of the last announcement
  bool is_newest = false;                        ///< of its node
  MonotonicInstant replaced;                     ///< when another one became the newest

  /// Whether datagrams are accepted: the newest session of its node, or within the grace time.
  bool is_valid(MonotonicInstant now) const {
    return is_newest || now - replaced < OwnFrameKey::kAcceptOld;
  }
};

/// The frame sessions that a receiver has accepted: at most two for each node, kMaxSessions in all.
/// When there are more, the one that was announced longest ago is removed. Keys are erased when
/// their session is removed. The caller verifies announcements. One thread.
class FrameSessions {
 public:
  static constexpr size_t kMaxSessions = 64;
  /// Opens the key of the announcement; null when it is not sealed for this process.
  using OpenKey = std::function<std::shared_ptr<const wire::DatagramMac>()>;

  FrameSessions() { sessions_.reserve(kMaxSessions); }

  /// Notes that `node` sends its frames in this session, and removes sessions whose grace time is
  /// over. Calls `open` only while the session has no key. Returns the id of the session.
  uint32_t announce(std::string_view node, uint32_t number, const wire::KeyId& signer,
                    MonotonicInstant now, const OpenKey& open);
  /// The sessions with this number, some of them perhaps no longer valid. Almost always none or
  /// one. Allocates nothing. Valid until the next announce().
  std::span<const FrameSession> find(uint32_t number) const;
  /// Whether a session with this number is valid. Allocates nothing.
  bool has(uint32_t number, MonotonicInstant now) const;
  size_t size() const { return sessions_.size(); }

 private:
  FrameSession& find_or_add(std::string_view node, uint32_t number);
  void make_newest(uint32_t id, std::string_view node, MonotonicInstant now);
  void remove_invalid(MonotonicInstant now);

  std::vector<FrameSession> sessions_;  ///< sorted by number
  uint32_t last_id_ = 0;
};

}  // namespace v3d::bus
