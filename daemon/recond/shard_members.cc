#include "daemon/recond/shard_members.h"

#include <algorithm>

#include "daemon/recond/shard_share.h"

namespace v3d {

ShardMembers::ShardMembers(std::vector<std::string> roster, size_t me)
    : roster_(std::move(roster)), me_(me), members_(roster_.size()) {}

bool ShardMembers::hear(const ShardMessage& word, Duration now) {
  const auto found = std::find(roster_.begin(), roster_.end(), word.node);
  if (found == roster_.end()) return false;
  const auto place = static_cast<size_t>(found - roster_.begin());
  Member& member = members_[place];
  // The network reorders.
  if (place == me_ || (member.heard && word.sent <= member.word.sent)) return false;
  member.heard = now;
  for (const int64_t pulse : word.given_up) {
    if (pulse >= forgotten_) member.given_up.insert(pulse);
  }
  member.word = word;
  return true;
}

bool ShardMembers::lives(size_t place, Duration now) const {
  const auto& heard = members_[place].heard;
  return place == me_ || (heard && now - *heard < kSilent);
}

size_t ShardMembers::living(Duration now) const {
  size_t count = 0;
  for (size_t place = 0; place < size(); ++place) count += lives(place, now);
  return count;
}

bool ShardMembers::is_there(size_t place, int64_t pulse, Duration now) const {
  const int64_t first = members_[place].word.first;
  return first >= 0 && first <= pulse && lives(place, now);
}

std::vector<bool> ShardMembers::who_is_there(int64_t pulse, Duration now) const {
  std::vector<bool> there(size());
  for (size_t place = 0; place < size(); ++place) there[place] = is_there(place, pulse, now);
  if (std::find(there.begin(), there.end(), true) == there.end()) there[me_] = true;
  return there;
}

size_t ShardMembers::maker(int64_t pulse, Duration now) const {
  return maker_of(pulse, who_is_there(pulse, now));
}

size_t ShardMembers::shower(int64_t pulse, Duration now) const {
  const std::vector<bool> there = who_is_there(pulse, now);
  return static_cast<size_t>(std::find(there.begin(), there.end(), true) - there.begin());
}

int ShardMembers::rank(int64_t pulse, Duration now) const {
  const size_t maker = this->maker(pulse, now);
  int rank = 0;
  for (size_t step = 1; (maker + step) % size() != me_ && step < size(); ++step) {
    rank += is_there((maker + step) % size(), pulse, now);
  }
  return rank;
}

void ShardMembers::forget_before(int64_t pulse) {
  forgotten_ = std::max(forgotten_, pulse);
  for (Member& member : members_) {
    member.given_up.erase(member.given_up.begin(), member.given_up.lower_bound(forgotten_));
  }
}

}  // namespace v3d
