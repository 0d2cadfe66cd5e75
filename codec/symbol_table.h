// Frequency table of 256 symbols, in slots of a RansDecoder. It is transmitted before the symbols.
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
/// Slots of each symbol. Their sum is kSlots, or 0 when no symbol occurs.
using SymbolSlots = std::array<uint16_t, kSymbols>;

/// Distributes the slots in proportion to the counts; each symbol with a count greater than 0 gets
/// at least one.
SymbolSlots slots_of(const SymbolCounts& counts);
/// The first slot of each symbol.
SymbolSlots first_slots(const SymbolSlots& slots);

/// [slot]
using SlotTable = std::array<uint32_t, kSlots>;
/// Entry of a table without slots. No valid entry has its position after its slots.
inline constexpr uint32_t kNoSymbol = 255 | 1U << 8;
/// Computes the decoding table.
void fill(const SymbolSlots& slots, SlotTable& table);
/// Fields of an entry, for RansDecoder::take().
inline uint32_t symbol_in(uint32_t entry) { return entry & 255; }
inline uint32_t place_in(uint32_t entry) { return entry >> 8 & (kSlots - 1); }
inline uint32_t slots_in(uint32_t entry) { return (entry >> (8 + kSlotBits)) + 1; }

/// Codes a sequence of tables. Each is predicted from the previous one.
class SlotsModel {
 public:
  /// Codes one table. False when the decoded table is invalid. The decoder starts with a table of
  /// zeros.
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
  /// [number of binary digits of the slots in the previous table].
  std::array<NumberModel, kSlotBits + 2> numbers_;
  SymbolSlots before_{};
};

}  // namespace v3d
