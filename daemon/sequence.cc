#include "daemon/sequence.h"

#include <algorithm>
#include <utility>

namespace v3d {

int64_t SequenceTracker::missed_before(const std::string& key, int64_t seq) {
  const auto found = last_.find(key);
  if (found == last_.end()) {
    if (last_.size() < kMaxKeys) last_.emplace(key, seq);
    return 0;
  }
  const int64_t last = std::exchange(found->second, seq);
  return seq > last ? std::min(seq - last - 1, kMaxMissed) : 0;
}

}  // namespace v3d
