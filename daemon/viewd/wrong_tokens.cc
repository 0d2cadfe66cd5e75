#include "daemon/viewd/wrong_tokens.h"

#include <algorithm>

namespace v3d {

const std::string& WrongTokens::key_of(const std::string& address) const {
  static const std::string kOthers;
  const bool known = tries_.contains(address) || tries_.size() < kMostAddresses;
  return known ? address : kOthers;
}

Duration WrongTokens::pause_of(const std::string& address, MonotonicInstant now) const {
  const auto found = tries_.find(key_of(address));
  if (found == tries_.end()) return Duration::zero();
  constexpr int64_t kMostDoublings = 6;
  const int64_t doublings = std::min(found->second.wrong - 1, kMostDoublings);
  const Duration pause = std::min(kFirstPause * (int64_t{1} << doublings), kLongestPause);
  return std::max(Duration::zero(), found->second.last + pause - now);
}

void WrongTokens::wrong(const std::string& address, MonotonicInstant now) {
  forget(now);
  Tries& tries = tries_[key_of(address)];
  ++tries.wrong;
  tries.last = now;
}

void WrongTokens::right(const std::string& address) { tries_.erase(address); }

void WrongTokens::forget(MonotonicInstant now) {
  std::erase_if(tries_,
                [&](const auto& entry) { return now - entry.second.last > kForgottenAfter; });
}

}  // namespace v3d
