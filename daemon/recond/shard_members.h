// The nodes that share a take, by what they say of themselves.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/time.h"
#include "wire/messages.h"

namespace v3d {

/// Who is silent is not there. Times are of one ActiveTimeClock, and never go back. One thread.
class ShardMembers {
 public:
  static constexpr Duration kSilent = std::chrono::milliseconds(400);

  /// `roster` is sorted, and `me` a place in it.
  ShardMembers(std::vector<std::string> roster, size_t me);

  /// What a node says of itself. False when it is none of the others, or an old word.
  bool hear(const ShardMessage& word, Duration now);
  /// This node answers for its share from `pulse` on.
  void join(int64_t pulse) { members_[me_].word.first = pulse; }
  /// This node's share has no mesh there.
  void give_up(int64_t pulse) { members_[me_].given_up.insert(pulse); }

  size_t size() const { return members_.size(); }
  bool lives(size_t place, Duration now) const;
  size_t living(Duration now) const;
  /// Lives and answers for its share at `pulse`.
  bool is_there(size_t place, int64_t pulse, Duration now) const;
  /// Who makes the mesh of `pulse`, and who shows it; this node when nobody is there.
  size_t maker(int64_t pulse, Duration now) const;
  size_t shower(int64_t pulse, Duration now) const;
  /// Of the others who live and answer for `pulse`, so many come before this node.
  int rank(int64_t pulse, Duration now) const;
  /// The last word of another.
  const ShardMessage& word(size_t place) const { return members_[place].word; }
  bool has_given_up(size_t place, int64_t pulse) const {
    return members_[place].given_up.contains(pulse);
  }
  /// Nobody asks for pulses before this one any more.
  void forget_before(int64_t pulse);

 private:
  struct Member {
    ShardMessage word;
    std::optional<Duration> heard;
    std::set<int64_t> given_up;
  };
  std::vector<bool> who_is_there(int64_t pulse, Duration now) const;

  const std::vector<std::string> roster_;
  const size_t me_;
  std::vector<Member> members_;  ///< by place
  int64_t forgotten_ = 0;        ///< pulses before this one
};

}  // namespace v3d
