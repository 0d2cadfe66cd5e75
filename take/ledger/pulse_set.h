// Pulse numbers as they are counted while a take is recorded.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

namespace v3d {

/// A set, kept as runs of neighbours: a train without gaps takes the same memory however long it
/// is. Any number will do. One thread.
class PulseSet {
 public:
  /// False when it was there already.
  bool insert(int64_t pulse);
  bool contains(int64_t pulse) const;
  int64_t size() const { return size_; }
  /// The highest; -1 when there is none.
  int64_t last() const { return runs_.empty() ? -1 : runs_.rbegin()->second; }
  /// All of them, rising.
  std::vector<int64_t> all() const;
  /// Those of [0, commanded) that are not in it, rising.
  std::vector<int64_t> missing(int64_t commanded) const;
  /// Those in it that are not of [0, commanded), rising.
  std::vector<int64_t> outside(int64_t commanded) const;

 private:
  std::map<int64_t, int64_t> runs_;  ///< the first of a run and its last
  int64_t size_ = 0;
};

}  // namespace v3d
