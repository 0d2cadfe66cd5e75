#include "daemon/recond/shard_share.h"

#include <algorithm>
#include <numeric>

#include "base/check.h"

namespace v3d {

size_t maker_of(int64_t pulse, const std::vector<bool>& there) {
  const auto size = static_cast<int64_t>(there.size());
  const auto living = std::count(there.begin(), there.end(), true);
  V3D_CHECK(living > 0);
  const auto slot = static_cast<size_t>(pulse % size);
  if (there[slot]) return slot;
  auto left = (pulse / size) % living;
  size_t place = 0;
  while (!there[place] || left-- > 0) ++place;
  return place;
}

FrameGroupSet groups_of(size_t place, size_t nodes, size_t groups) {
  // A pulse is `place` modulo `nodes` and g modulo `groups` at once for every g of this kind.
  const size_t step = std::gcd(nodes, groups);
  FrameGroupSet found;
  for (size_t group = place % step; group < groups; group += step) found.insert(group);
  return found;
}

}  // namespace v3d
