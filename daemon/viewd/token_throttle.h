// Throttle of wrong operators' tokens.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// Limits the rate of wrong tokens by address. After a wrong token, further wrong ones of the same
/// address get 429 for 1 s, then for 2 s, 4 s and so on, up to a minute. A right token is never
/// delayed (CommandEndpoint compares first), and clears its address. Memory is bounded: beyond
/// kMaxAddresses, all further addresses share one entry. One thread.
class TokenThrottle {
 public:
  static constexpr size_t kMaxAddresses = 64;
  static constexpr Duration kFirstDelay = std::chrono::seconds(1);
  static constexpr Duration kMaxDelay = std::chrono::minutes(1);
  /// An address is forgotten after this time without a wrong token.
  static constexpr Duration kEntryLifetime = std::chrono::minutes(10);

  /// How long from `now` a wrong token of this address gets 429; zero: it gets 401.
  Duration delay_for(const std::string& address, MonotonicInstant now) const;
  void record_wrong(const std::string& address, MonotonicInstant now);
  void record_right(const std::string& address);

 private:
  struct Entry {
    int64_t wrong = 0;
    MonotonicInstant last;
  };
  const std::string& key_of(const std::string& address) const;
  void remove_old(MonotonicInstant now);

  std::map<std::string, Entry> entries_;
};

}  // namespace v3d
