// A secret key that is replaced while the studio runs, with the key before it for a grace time.
#pragma once

#include <optional>
#include <utility>

#include "base/core/time.h"

namespace v3d {

/// Key files are replaced on one PC after the other. So each process accepts the new key at once,
/// but sends with the old key for kSendOld: by then the other PCs have the new key too. It accepts
/// the old key for kAcceptOld, twice as long: another PC may have started to count kSendOld later.
/// No message is lost when all PCs get the new key within kSendOld. A third key within that time
/// ends the first one at once.
///
/// Time is an argument. One thread.
template <class Key>
class KeyRotation {
 public:
  static constexpr Duration kSendOld = std::chrono::seconds(10);
  static constexpr Duration kAcceptOld = 2 * kSendOld;

  /// The first key is used at once.
  void set(Key key, MonotonicInstant now) {
    old_ = std::exchange(key_, std::move(key));
    since_ = now;
  }
  /// Whether there is a key.
  bool has_key() const { return key_.has_value(); }

  /// The key to send with; null where there is none.
  const Key* sending(MonotonicInstant now) const {
    if (old_ && now - since_ < kSendOld) return &*old_;
    return key_ ? &*key_ : nullptr;
  }
  /// The new key, and null where there is none.
  const Key* newest() const { return key_ ? &*key_ : nullptr; }
  /// The key before it, while it is accepted; otherwise null.
  const Key* old(MonotonicInstant now) const {
    return old_ && now - since_ < kAcceptOld ? &*old_ : nullptr;
  }
  /// Releases the old key when its time is over, which wipes it.
  void forget_old(MonotonicInstant now) {
    if (old(now) == nullptr) old_.reset();
  }

 private:
  std::optional<Key> key_, old_;
  MonotonicInstant since_;  ///< when `key_` was set
};

}  // namespace v3d
