// Slows down who guesses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "base/time.h"

namespace v3d {

/// After a wrong token the next of the same address is not looked at for a second, after another
/// for two, then four, up to a minute; a right one clears that. What is remembered is bounded: of
/// more addresses than that, all others are counted as one. One thread.
class WrongTokens {
 public:
  static constexpr size_t kMostAddresses = 64;
  static constexpr Duration kFirstPause = std::chrono::seconds(1);
  static constexpr Duration kLongestPause = std::chrono::minutes(1);
  /// Who has not tried for so long is forgotten.
  static constexpr Duration kForgottenAfter = std::chrono::minutes(10);

  /// How long from `now` until a token of this address is looked at; zero: it is.
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
