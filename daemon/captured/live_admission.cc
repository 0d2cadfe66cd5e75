#include "daemon/captured/live_admission.h"

namespace v3d::captured {

bool LiveAdmission::admits(int64_t pulse) {
  const std::lock_guard lock(mutex_);
  if (const auto known = decided_.find(pulse); known != decided_.end()) return known->second;
  const bool live = backlog_() <= limit_;
  decided_.emplace(pulse, live);
  if (!live) ++skipped_;
  if (decided_.size() > kMaxDecisions) decided_.erase(decided_.begin());
  return live;
}

int64_t LiveAdmission::skipped() const {
  const std::lock_guard lock(mutex_);
  return skipped_;
}

}  // namespace v3d::captured
