#include "daemon/credentials.h"

#include "base/check.h"

namespace v3d {

void Credentials::set_studio_key(const StudioKey& key, MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  studio_keys_.set(key, now);
}

void Credentials::forget_old_key(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  studio_keys_.forget_old(now);
}

bool Credentials::has_studio_key() const {
  const std::lock_guard lock(mutex_);
  return studio_keys_.has_key();
}

Bytes Credentials::seal(Bytes message, MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  const StudioKey* const key = studio_keys_.sending(now);
  V3D_CHECK(key != nullptr);
  key->seal(message);
  return message;
}

bool Credentials::has_sealed(std::span<const uint8_t> message, MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  const StudioKey* const newest = studio_keys_.newest();
  if (newest != nullptr && newest->has_sealed(message)) return true;
  const StudioKey* const old = studio_keys_.old(now);
  return old != nullptr && old->has_sealed(message);
}

}  // namespace v3d
