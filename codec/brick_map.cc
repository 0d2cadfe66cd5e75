#include "codec/brick_map.h"

namespace v3d {

void BrickMap::clear(const std::array<int, 3>& counts) {
  counts_ = counts;
  words_per_row_ = (counts[0] + kBitsPerWord - 1) / kBitsPerWord;
  bits_.assign(words_per_row() * counts[1] * counts[2], 0);
}

int BrickMap::number() {
  first_.resize(bits_.size());
  int32_t count = 0;
  for (size_t w = 0; w < bits_.size(); ++w) {
    first_[w] = count;
    count += bit_count(bits_[w]);
  }
  return count;
}

}  // namespace v3d
