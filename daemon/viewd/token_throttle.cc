#include "daemon/viewd/token_throttle.h"

#include <algorithm>

namespace v3d {

const std::string& TokenThrottle::key_of(const std::string& address) const {
  static const std::string kOthers;
  const bool known = entries_.contains(address) || entries_.size() < kMaxAddresses;
  return known ? address : kOthers;
}

Duration TokenThrottle::delay_for(const std::string& address, MonotonicInstant now) const {
  const auto found = entries_.find(key_of(address));
  if (found == entries_.end()) return Duration::zero();
  constexpr int64_t kMaxDoublings = 6;
  const int64_t doublings = std::min(found->second.wrong - 1, kMaxDoublings);
  const Duration delay = std::min(kFirstDelay * (int64_t{1} << doublings), kMaxDelay);
  return std::max(Duration::zero(), found->second.last + delay - now);
}

void TokenThrottle::record_wrong(const std::string& address, MonotonicInstant now) {
  remove_old(now);
  Entry& entry = entries_[key_of(address)];
  ++entry.wrong;
  entry.last = now;
}

void TokenThrottle::record_right(const std::string& address) { entries_.erase(address); }

void TokenThrottle::remove_old(MonotonicInstant now) {
  std::erase_if(entries_,
                [&](const auto& entry) { return now - entry.second.last > kEntryLifetime; });
}

}  // namespace v3d
