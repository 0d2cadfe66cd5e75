// Counts what did not arrive: LCM has no drop counter, so every message carries a sequence number.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// Of the messages of one sender on one channel.
struct SequenceCounts {
  int64_t received = 0;   ///< each once
  int64_t lost = 0;       ///< sent before the newest that arrived, and not here
  int64_t late = 0;       ///< of `received`: overtaken by others
  int64_t duplicate = 0;  ///< came again

  SequenceCounts& operator+=(const SequenceCounts& other);
  friend bool operator==(const SequenceCounts&, const SequenceCounts&) = default;
};

/// Networks lose, repeat and reorder. One thread.
class SequenceTracker {
 public:
  /// `from_start`: this listens since before a sender's first message, which has the number 0: what
  /// does not come before the first that arrives is lost, too.
  explicit SequenceTracker(bool from_start = false) : from_start_(from_start) {}

  /// Every message of `key`, as it arrives. `seq` is 0 or more. `sent` is by the clock of the
  /// sender: a number that does not rise, but was sent later, or ten seconds earlier or more, is of
  /// a sender that started again.
  void note(const std::string& key, int64_t seq, RealtimeInstant sent);

  /// What was sent of `key` until now was not listened to, and is not lost.
  void listen_anew(const std::string& key);

  /// Of one key, and of all.
  SequenceCounts of(const std::string& key) const;
  const SequenceCounts& total() const { return total_; }

 private:
  /// Anybody can invent channels and numbers: so many are followed, so many believed to be missing
  /// at once, and so many of each key waited for.
  static constexpr size_t kMaxKeys = 1024;
  static constexpr int64_t kMaxMissed = 1'000'000;
  static constexpr int64_t kMaxAwaited = 4096;

  struct Sender {
    int64_t newest = -1;
    RealtimeInstant newest_sent = {};
    std::set<int64_t> awaited = {};  ///< numbers below the newest that have not come
    SequenceCounts counts = {};
    bool from_start = false;  ///< as above
  };
  /// What this message adds to the counts.
  SequenceCounts arrived(Sender& sender, int64_t seq, RealtimeInstant sent) const;

  const bool from_start_;
  std::map<std::string, Sender> senders_;
  SequenceCounts total_;
};

}  // namespace v3d
