#include "codec/range_coder.h"

namespace v3d {

void RangeEncoder::shift_out() {
  const auto word = static_cast<uint32_t>(low_ >> 32);
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes_.push_back(static_cast<uint8_t>(word >> shift));
  low_ <<= 32;
  range_ <<= 32;
}

void RangeEncoder::carry() {
  for (size_t n = bytes_.size(); n-- > 0 && ++bytes_[n] == 0;) {
  }
}

std::vector<uint8_t> RangeEncoder::take() {
  // Any number from low to low + range - 1 decodes correctly. Choose the one with the fewest bytes
  // before a run of zeros, because the decoder reads zeros after the end.
  for (int kept = 8; kept <= 64; kept += 8) {
    const uint64_t low_bits = kept == 64 ? 0 : ~uint64_t{0} >> kept;
    const uint64_t number = (low_ + low_bits) & ~low_bits;
    if (number - low_ >= range_) continue;
    if (number < low_) carry();
    for (int shift = 56; shift >= 64 - kept; shift -= 8) {
      bytes_.push_back(static_cast<uint8_t>(number >> shift));
    }
    break;
  }
  low_ = 0;
  range_ = ~uint64_t{0};
  return std::exchange(bytes_, {});
}

}  // namespace v3d
