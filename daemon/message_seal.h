// What is believed of all that is no command: sealed with the studio key, of now, and not heard
// before.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "base/time.h"
#include "wire/studio_key.h"

namespace v3d {

/// Messages that were not believed, by why.
struct SealCounts {
  int64_t forged = 0;    ///< without the studio's seal, or changed since
  int64_t stale = 0;     ///< sealed, but sent too long ago, or in the future
  int64_t replayed = 0;  ///< heard before; a network that repeats does that, too
};

/// The seal stands behind the message: tools that know the type pass over it, and logs of messages
/// hold none. With a key, what is sent is sealed, and only what is sealed is believed. Without one
/// nothing is sealed, and anything is taken for what it says, unless somebody insists: daemons do,
/// who only look on do not. Any thread.
class MessageSeal {
 public:
  void set_key(const StudioKey& key);
  /// Nothing is believed without a key, either.
  void insist();

  /// The message with its seal, where there is a key.
  Bytes closed(Bytes message) const;
  /// The message in `bytes`; empty, and counted, when it is not believed.
  std::optional<std::span<const uint8_t>> open(std::span<const uint8_t> bytes);
  /// Only what is of now is believed (NewsGate).
  bool asks_for_news() const { return has_key_; }

  void count_stale(Duration age);
  void count_replayed() { ++replayed_; }
  SealCounts counts() const;
  /// One line for a person when messages were refused shortly before `now`, else empty.
  std::string trouble(RealtimeInstant now) const;

 private:
  std::optional<StudioKey> key() const;
  void note(const std::string& trouble);

  std::atomic<bool> has_key_ = false;
  std::atomic<bool> insists_ = false;
  std::atomic<int64_t> forged_ = 0;
  std::atomic<int64_t> stale_ = 0;
  std::atomic<int64_t> replayed_ = 0;
  mutable std::mutex mutex_;  ///< what follows
  std::optional<StudioKey> key_;
  std::string trouble_;
  RealtimeInstant troubled_;
};

/// Which messages of a channel are of now, each once. They may overtake each other. One thread.
class NewsGate {
 public:
  /// A message may be so old: networks and clocks are slow.
  static constexpr Duration kOldest = std::chrono::seconds(5);
  /// So far may the clock of the sender be ahead of this node's.
  static constexpr Duration kAhead = std::chrono::seconds(2);

  enum class Verdict : uint8_t { kNews, kStale, kHeard };
  Verdict judge(const std::string& sender, int64_t seq, RealtimeInstant sent, RealtimeInstant now);

 private:
  /// Of each sender the messages of the last kOldest are remembered, and no more than so many; what
  /// is older than all of these is stale.
  static constexpr size_t kRemembered = 1024;
  static constexpr size_t kMaxSenders = 256;

  struct Heard {
    std::set<std::pair<RealtimeInstant, int64_t>> messages;
    RealtimeInstant floor;
  };
  std::map<std::string, Heard> senders_;
};

}  // namespace v3d
