#include "codec/rans.h"

namespace v3d {

void RansEncoder::finish(ByteWriter& bytes) const {
  bytes.number(state_);
  for (size_t n = words_.size(); n-- > 0;) bytes.number(words_[n]);
}

RansDecoder::RansDecoder(std::span<const uint8_t> bytes) : bytes_(bytes) {
  state_ = next_word();
  state_ |= uint64_t{next_word()} << 32;
  valid_ = state_ >= kRansStart && state_ >> 32 < kRansStart;
}

}  // namespace v3d
