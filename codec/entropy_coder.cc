#include "codec/entropy_coder.h"

#include <numeric>

namespace v3d::codec {

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

void RansEncoder::finish(ByteWriter& bytes) const {
  bytes.number(state_);
  for (size_t n = words_.size(); n-- > 0;) bytes.number(words_[n]);
}

RansDecoder::RansDecoder(std::span<const uint8_t> bytes) : bytes_(bytes) {
  state_ = next_word();
  state_ |= uint64_t{next_word()} << 32;
  valid_ = state_ >= kRansStart && state_ >> 32 < kRansStart;
}

SymbolSlots slots_of(const SymbolCounts& counts) {
  SymbolSlots slots{};
  const uint64_t all = std::accumulate(counts.begin(), counts.end(), uint64_t{0});
  if (all == 0) return slots;
  int left = kSlots;
  for (size_t symbol = 0; symbol < kSymbols; ++symbol) {
    if (counts[symbol] == 0) continue;
    const uint64_t share = (counts[symbol] * uint64_t{kSlots} + all / 2) / all;
    slots[symbol] = static_cast<uint16_t>(std::max<uint64_t>(share, 1));
    left -= slots[symbol];
  }
  // Add a surplus of slots to the largest symbols, or take a deficit from them, in small steps:
  // this costs the least.
  while (left != 0) {
    uint16_t& largest = *std::max_element(slots.begin(), slots.end());
    const int change = std::max(left, -std::max(largest / 8, 1));
    largest = static_cast<uint16_t>(largest + change);
    left -= change;
  }
  return slots;
}

SymbolSlots first_slots(const SymbolSlots& slots) {
  SymbolSlots first{};
  std::exclusive_scan(slots.begin(), slots.end(), first.begin(), uint16_t{0});
  return first;
}

void fill(const SymbolSlots& slots, SlotTable& table) {
  table.fill(kNoSymbol);
  size_t slot = 0;
  for (uint32_t symbol = 0; symbol < kSymbols; ++symbol) {
    for (uint32_t place = 0; place < slots[symbol]; ++place) {
      table[slot++] = symbol | place << 8 | (uint32_t{slots[symbol]} - 1) << (8 + kSlotBits);
    }
  }
}

}  // namespace v3d::codec
