#include "codec/symbol_table.h"

#include <numeric>

namespace v3d {

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

}  // namespace v3d
