// How often each of 256 symbols comes, told before they are: by slots of a RansDecoder.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "codec/range_coder.h"
#include "codec/rans.h"

namespace v3d {

inline constexpr uint32_t kSymbols = 256;
using SymbolCounts = std::array<uint32_t, kSymbols>;
/// Of each symbol; kSlots together, or none where no symbol comes at all.
using SymbolSlots = std::array<uint16_t, kSymbols>;

/// In proportion to the counts, but for each that is not 0 at least one.
SymbolSlots slots_of(const SymbolCounts& counts);
/// The first slot of each symbol.
SymbolSlots first_slots(const SymbolSlots& slots);

/// [slot]
using SlotTable = std::array<uint32_t, kSlots>;
/// Entry of a table without slots. No other has its place behind its slots.
inline constexpr uint32_t kNoSymbol = 255 | 1U << 8;
void fill(const SymbolSlots& slots, SlotTable& table);
/// What an entry tells, for RansDecoder::take().
inline uint32_t symbol_in(uint32_t entry) { return entry & 255; }
inline uint32_t place_in(uint32_t entry) { return entry >> 8 & (kSlots - 1); }
inline uint32_t slots_in(uint32_t entry) { return (entry >> (8 + kSlotBits)) + 1; }

/// Codes one table after the other, each a little like the one before.
class SlotsModel {
 public:
  /// False: what was decoded is not a table. The decoder's begins as 0.
  template <class Coder>
  bool code(Coder& coder, SymbolSlots& slots) {
    const bool some = std::any_of(slots.begin(), slots.end(), [](uint16_t n) { return n > 0; });
    if (!coder.bit(some_, some)) return true;
    uint32_t sum = 0;
    for (size_t symbol = 0; symbol < kSymbols; ++symbol) {
      NumberModel& model = numbers_[static_cast<size_t>(std::bit_width(before_[symbol]))];
      const uint32_t number = std::min(model.code(coder, slots[symbol]), kSlots + 1);
      slots[symbol] = static_cast<uint16_t>(number);
      sum += number;
    }
    before_ = slots;
    return sum == kSlots;
  }

 private:
  BitModel some_;
  std::array<NumberModel, kSlotBits + 2> numbers_;  ///< by digits of what the table before had
  SymbolSlots before_{};
};

}  // namespace v3d
