// Anti-replay windows: which messages of each sending session have been received.
#pragma once

#include <bitset>
#include <cstdint>
#include <vector>

#include "base/time.h"

namespace v3d {

/// A message is accepted once. Messages may overtake each other by up to kWindow - 1; older ones
/// count as received. kMaxSessions are remembered; when there are more, the one whose last message
/// was sent first is forgotten, and from unknown sessions nothing is accepted that was sent before
/// that. Only authenticated messages may be noted, and only such as are fresh: so nobody without
/// the key changes anything here. One thread.
/// Source: RFC 6479, with one bit a message.
class SequenceWindows {
 public:
  static constexpr uint32_t kWindow = 1024;
  static constexpr size_t kMaxSessions = 256;

  SequenceWindows() { sessions_.reserve(kMaxSessions); }

  /// Sequence numbers wrap.
  bool is_received(uint32_t session, uint32_t sequence, RealtimeInstant sent) const;
  void note(uint32_t session, uint32_t sequence, RealtimeInstant sent);

 private:
  struct Session {
    uint32_t id = 0;
    uint32_t newest = 0;
    RealtimeInstant sent;           ///< of the newest
    std::bitset<kWindow> received;  ///< by sequence number modulo kWindow
  };
  const Session* find(uint32_t session) const;
  Session& find_or_add(uint32_t session, uint32_t sequence);

  std::vector<Session> sessions_;
  RealtimeInstant floor_ = RealtimeInstant::min();
};

}  // namespace v3d
