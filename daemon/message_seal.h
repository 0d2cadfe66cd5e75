// Which messages that are no commands are accepted: authenticated with the studio key, recent, and
// not received before.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "base/time.h"
#include "wire/datagram_mac.h"

namespace v3d {

/// What was rejected, by cause.
struct SealCounts {
  int64_t forged = 0;    ///< datagrams without the studio's MAC, or changed since
  int64_t stale = 0;     ///< authentic, but sent too long ago, or in the future
  int64_t replayed = 0;  ///< received before; a network that repeats does that, too
};

/// The studio key of this process, and the account of what was rejected under it. With a key, what
/// is sent carries a MAC in each datagram (wire/datagram_mac.h), and only what carries one is
/// accepted. Without a key nothing carries one, and every message is accepted, unless a daemon has
/// called insist(): `v3dctl watch` without a key only shows. Any thread.
class MessageSeal {
 public:
  void set_key(const StudioKey& key);
  /// Nothing is accepted without a key, either.
  void insist() { insists_ = true; }

  /// Null as long as there is no key.
  std::shared_ptr<const DatagramMac> mac() const;
  /// Whether messages must be authenticated.
  bool is_required() const { return has_key_ || insists_; }
  /// Only recent messages are accepted (NewsGate).
  bool asks_for_news() const { return has_key_; }

  void count_forged();
  void count_stale(Duration age);
  void count_replayed() { ++replayed_; }
  SealCounts counts() const;
  /// Something was rejected that no count here holds. Allocates nothing after the first time.
  void report(std::string_view trouble);
  /// One line for a person when messages were rejected shortly before `now`, else empty.
  std::string trouble(RealtimeInstant now) const;

 private:
  std::atomic<bool> has_key_ = false;
  std::atomic<bool> insists_ = false;
  std::atomic<int64_t> forged_ = 0;
  std::atomic<int64_t> stale_ = 0;
  std::atomic<int64_t> replayed_ = 0;
  mutable std::mutex mutex_;  ///< what follows
  std::shared_ptr<const DatagramMac> mac_;
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
