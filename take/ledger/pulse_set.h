// PulseSet: a compact set of the pulse numbers of a take.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

namespace v3d {

/// A set of pulse numbers, stored as runs of consecutive numbers: memory depends on the number of
/// gaps, not on the length of the take. Accepts any number. One thread.
class PulseSet {
 public:
  /// Returns false when the set already contains `pulse`.
  bool insert(int64_t pulse);
  bool contains(int64_t pulse) const;
  int64_t size() const { return size_; }
  /// The highest number; -1 when the set is empty.
  int64_t last() const { return runs_.empty() ? -1 : runs_.rbegin()->second; }
  /// All numbers, ascending.
  std::vector<int64_t> all() const;
  /// Numbers of [0, commanded) that the set does not contain, ascending.
  std::vector<int64_t> missing(int64_t commanded) const;
  /// Numbers of the set outside of [0, commanded), ascending.
  std::vector<int64_t> outside(int64_t commanded) const;

 private:
  std::map<int64_t, int64_t> runs_;  ///< first to last number of a run
  int64_t size_ = 0;
};

}  // namespace v3d
