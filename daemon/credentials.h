// The keys that authenticate commands and replies: what this process signs with, and whom it
// accepts.
#pragma once

#include <mutex>
#include <span>

#include "base/time.h"
#include "daemon/key_rotation.h"
#include "wire/studio_key.h"

namespace v3d {

/// Without a studio key nothing is sent or accepted. Any thread.
class Credentials {
 public:
  /// Replaces the studio key; the one before it stays valid as KeyRotation says.
  void set_studio_key(const StudioKey& key, MonotonicInstant now);
  /// Wipes a studio key whose time is over.
  void forget_old_key(MonotonicInstant now);
  bool has_studio_key() const;

  /// The encoded command or reply with its MAC. Requires has_studio_key().
  Bytes seal(Bytes message, MonotonicInstant now) const;
  /// Whether a command or reply has the MAC of a valid studio key.
  bool has_sealed(std::span<const uint8_t> message, MonotonicInstant now) const;

 private:
  mutable std::mutex mutex_;  ///< what follows
  KeyRotation<StudioKey> studio_keys_;
};

}  // namespace v3d
