// Throttle of wrong tokens.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "base/time.h"

namespace v3d {

/// Throttle of wrong tokens, by address: after a wrong token the next wrong one of the same address
/// gets no answer but 429 for 1 s, after another for 2 s, then 4 s, up to a minute. A right token
/// is never asked for a pause (CommandEndpoint compares first), and clears its address. Memory is
/// bounded: of more addresses than kMaxAddresses, all others are counted as one. One thread.
class TokenThrottle {
 public:
  static constexpr size_t kMaxAddresses = 64;
  static constexpr Duration kFirstPause = std::chrono::seconds(1);
  static constexpr Duration kLongestPause = std::chrono::minutes(1);
  /// Who has not tried for so long is forgotten.
  static constexpr Duration kForgottenAfter = std::chrono::minutes(10);

  /// How long from `now` a wrong token of this address is answered by 429; zero: by 401.
  Duration pause_of(const std::string& address, MonotonicInstant now) const;
  void wrong(const std::string& address, MonotonicInstant now);
  void right(const std::string& address);

 private:
  struct Tries {
    int64_t wrong = 0;
    MonotonicInstant last;
  };
  const std::string& key_of(const std::string& address) const;
  void forget(MonotonicInstant now);

  std::map<std::string, Tries> tries_;
};

}  // namespace v3d
