// Counts lost messages by their sequence numbers, because LCM has no loss counter.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// Counts of the messages of one sender on one channel.
struct SequenceCounts {
  int64_t received = 0;   ///< each message once
  int64_t lost = 0;       ///< sent before the newest arrived message, and not received
  int64_t late = 0;       ///< of `received`: arrived after a newer message
  int64_t duplicate = 0;  ///< received again

  SequenceCounts& operator+=(const SequenceCounts& other);
  friend bool operator==(const SequenceCounts&, const SequenceCounts&) = default;
};

/// Detects lost, late and duplicate messages of many senders. One thread.
class SequenceTracker {
 public:
  /// `from_start`: reception starts before each sender's first message, which has the number 0.
  /// Messages before the first arrived one then count as lost too.
  explicit SequenceTracker(bool from_start = false) : from_start_(from_start) {}

  /// Records a message of the sender `key` at its arrival. `seq` is 0 or more; `sent` is a time of
  /// the sender's clock. A number that does not increase shows a restart of the sender when the
  /// message was sent later than the newest one, or at least 10 s earlier.
  void note(const std::string& key, int64_t seq, RealtimeInstant sent);

  /// Starts a new count for `key`: messages that were sent before this call do not count as lost.
  void start_new_count(const std::string& key);

  /// The counts of one key; total() is the sum over all keys.
  SequenceCounts of(const std::string& key) const;
  const SequenceCounts& total() const { return total_; }

 private:
  /// Limits against invented channels and numbers: of keys, of lost messages in one gap, and of
  /// missing numbers that are stored for a key.
  static constexpr size_t kMaxKeys = 1024;
  static constexpr int64_t kMaxMissed = 1'000'000;
  static constexpr int64_t kMaxMissingNumbers = 4096;

  struct Sender {
    int64_t newest = -1;
    RealtimeInstant newest_sent = {};
    std::set<int64_t> missing = {};  ///< numbers below the newest that have not arrived
    SequenceCounts counts = {};
    bool from_start = false;  ///< as in the constructor
  };
  /// The change of the counts by this message.
  SequenceCounts arrived(Sender& sender, int64_t seq, RealtimeInstant sent) const;

  const bool from_start_;
  std::map<std::string, Sender> senders_;
  SequenceCounts total_;
};

}  // namespace v3d
