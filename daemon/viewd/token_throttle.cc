#include "daemon/viewd/token_throttle.h"

#include <algorithm>

namespace v3d {

const std::string& TokenThrottle::key_of(const std::string& address) const {
  static const std::string kOthers;
  const bool known = tries_.contains(address) || tries_.size() < kMaxAddresses;
  return known ? address : kOthers;
}

Duration TokenThrottle::pause_of(const std::string& address, MonotonicInstant now) const {
  const auto found = tries_.find(key_of(address));
  if (found == tries_.end()) return Duration::zero();
  constexpr int64_t kMaxDoublings = 6;
  const int64_t doublings = std::min(found->second.wrong - 1, kMaxDoublings);
  const Duration pause = std::min(kFirstPause * (int64_t{1} << doublings), kLongestPause);
  return std::max(Duration::zero(), found->second.last + pause - now);
}

void TokenThrottle::wrong(const std::string& address, MonotonicInstant now) {
  forget(now);
  Tries& tries = tries_[key_of(address)];
  ++tries.wrong;
  tries.last = now;
}

void TokenThrottle::right(const std::string& address) { tries_.erase(address); }

void TokenThrottle::forget(MonotonicInstant now) {
  std::erase_if(tries_,
                [&](const auto& entry) { return now - entry.second.last > kForgottenAfter; });
}

}  // namespace v3d
