// Set of the tags of datagrams that a receiver has accepted lately, in memory of fixed size.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "wire/datagram_mac.h"

namespace v3d::bus {

/// Detects repeated datagrams before their MAC is computed. The tag is the MAC itself. A sender
/// without the key cannot make a datagram with a valid tag of its own; it can only repeat one that
/// was sent. Stores kSets * kWays tags; a new tag replaces the oldest one of its set. Allocates
/// nothing after construction. One thread.
class RecentTags {
 public:
  static constexpr size_t kSets = 2048;
  static constexpr size_t kWays = 4;
  using Tag = decltype(wire::MacTrailer::tag);

  RecentTags() : sets_(kSets) {}

  bool contains(const Tag& tag) const {
    const auto& tags = sets_[index_of(tag)].tags;
    return std::ranges::find(tags, tag) != tags.end();
  }
  void insert(const Tag& tag) {
    Set& set = sets_[index_of(tag)];
    set.tags[set.next] = tag;
    set.next = (set.next + 1) % kWays;
  }

 private:
  struct Set {
    std::array<Tag, kWays> tags{};  ///< zero: unused
    size_t next = 0;
  };
  static size_t index_of(const Tag& tag) { return (size_t{tag[0]} << 8 | tag[1]) % kSets; }

  std::vector<Set> sets_;
};

}  // namespace v3d::bus
