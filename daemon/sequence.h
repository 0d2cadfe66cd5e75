// Counts what did not arrive: LCM has no drop counter, so every message carries a sequence number.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace v3d {

/// One thread.
class SequenceTracker {
 public:
  /// The messages that were sent on `key` before `seq` (0 or more) and after the last one seen. A
  /// number that does not rise is a sender that started again: nothing is missed.
  int64_t missed_before(const std::string& key, int64_t seq);

 private:
  /// Anybody can invent channels and numbers: so many are followed, and so many believed at once.
  static constexpr size_t kMaxKeys = 256;
  static constexpr int64_t kMaxMissed = 1'000'000;

  std::map<std::string, int64_t> last_;
};

}  // namespace v3d
