// Replacement of a secret key while the studio runs. The previous key remains valid for a grace
// time.
#pragma once

#include <optional>
#include <utility>

#include "base/core/time.h"

namespace v3d {

/// Key files are replaced on one PC after the other. Each process therefore accepts the new key at
/// once, but sends with the old key for kSendOld, until the other PCs have the new key too. It
/// accepts the old key for kAcceptOld, which is twice as long: another PC may have read the new key
/// kSendOld later. No message is lost when all PCs get the new key within kSendOld. A third key
/// within that time invalidates the first key at once.
///
/// All times are arguments. One thread.
template <class Key, int kSendOldSeconds = 10>
class KeyRotation {
 public:
  static constexpr Duration kSendOld = std::chrono::seconds(kSendOldSeconds);
  static constexpr Duration kAcceptOld = 2 * kSendOld;

  /// Replaces the key. The first key is used for sending at once.
  void set(Key key, MonotonicInstant now) {
    old_ = std::exchange(key_, std::move(key));
    since_ = now;
  }
  bool has_key() const { return key_.has_value(); }

  /// The key to send with; null when there is none.
  const Key* sending(MonotonicInstant now) const {
    if (old_ && now - since_ < kSendOld) return &*old_;
    return key_ ? &*key_ : nullptr;
  }
  /// The newest key; null when there is none.
  const Key* newest() const { return key_ ? &*key_ : nullptr; }
  /// The previous key while it is accepted; otherwise null.
  const Key* old(MonotonicInstant now) const {
    return old_ && now - since_ < kAcceptOld ? &*old_ : nullptr;
  }
  /// Destroys the old key when its grace time is over; the destructor of a key erases it.
  void discard_old(MonotonicInstant now) {
    if (old(now) == nullptr) old_.reset();
  }

 private:
  std::optional<Key> key_, old_;
  MonotonicInstant since_;  ///< when `key_` was set
};

}  // namespace v3d
