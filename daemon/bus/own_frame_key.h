// The frame key with which this process sends its live frames, and its announcement.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "daemon/bus/key_rotation.h"
#include "daemon/bus/multicast_socket.h"
#include "wire/datagram_mac.h"
#include "wire/member_list.h"
#include "wire/messages.h"

namespace v3d {

/// Draws a frame key and a session for the live frames of this process, and a new pair when the
/// keys of the reconstruction nodes in the member list change. A revoked node therefore can neither
/// forge nor verify later frames.
///
/// A new key is announced at once and used from kSendOld later, so that receivers have it before
/// the first frame. They accept the previous key for kAcceptOld. Any thread.
class OwnFrameKey {
 public:
  struct Sending {
    explicit Sending(DatagramMac frame_mac) : mac(std::move(frame_mac)) {}
    const DatagramMac mac;
    SendingSession session;
  };
  using Rotation = KeyRotation<std::shared_ptr<Sending>, 1>;
  static constexpr Duration kAcceptOld = Rotation::kAcceptOld;

  /// Draws a key for the reconstruction nodes of this list, unless the key is for these already. Of
  /// more than kMaxFrameKeyRecipients keys, the others get none; returns false then.
  bool adapt_to(const MemberList& members, MonotonicInstant now);
  /// The message with the newest key, without a time. Requires adapt_to().
  FrameKeyMessage announcement() const;
  /// MAC and session for the next frame; null before adapt_to().
  std::shared_ptr<Sending> sending(MonotonicInstant now) const;

 private:
  mutable std::mutex mutex_;  ///< guards the members below
  std::vector<PublicKey> recipients_;
  std::vector<SealedFrameKey> sealed_;  ///< the newest key
  Rotation keys_;
};

}  // namespace v3d
