// Adaptive range coder, rANS coder and its frequency tables.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "codec/byte_stream.h"

namespace v3d::codec {

// Adaptive binary range coder. docs/compact-frame.md is normative.
//
// Functions code() accept the encoder or the decoder, so that one implementation serves both.
// bit(model, value) of the encoder codes `value` and returns it. bit() of the decoder ignores
// `value` and returns the decoded bit.

/// Adaptive probability that a bit is 0. It adapts fast at first and slowly later.
class BitModel {
 public:
  /// Probability of 0 in units of 1/65536, from 32 to 65504. So no bit is free, and no bit costs
  /// more than 11 bits.
  uint32_t zero() const { return zero_; }

  void learn(bool bit) {
    const int shift = kShifts[count_];
    const int target = bit ? kMinZero : kMaxZero;
    zero_ = static_cast<uint16_t>(zero_ + ((target - zero_) >> shift));
    count_ = static_cast<uint16_t>(count_ + (count_ < kShifts.size() - 1));
  }

 private:
  static constexpr int kMinZero = 32;
  static constexpr int kMaxZero = 65536 - 32;
  static constexpr std::array<uint8_t, 24> kShifts{1, 2, 2, 3, 3, 3, 4, 4, 4, 4, 4, 4,
                                                   5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6};
  uint16_t zero_ = 32768;
  uint16_t count_ = 0;  ///< number of bits so far, at most the last index of kShifts
};

class RangeEncoder {
 public:
  bool bit(BitModel& model, bool value) {
    split((range_ >> 16) * model.zero(), value);
    model.learn(value);
    return value;
  }
  /// Codes a bit with equal probabilities of 0 and 1.
  bool even_bit(bool value) {
    split(range_ >> 1, value);
    return value;
  }
  /// Returns all bytes and resets the encoder.
  std::vector<uint8_t> take();

 private:
  void split(uint64_t zero, bool value) {
    if (value) {
      low_ += zero;
      if (low_ < zero) carry();
      range_ -= zero;
    } else {
      range_ = zero;
    }
    if (range_ < uint64_t{1} << 32) shift_out();
  }
  void shift_out();
  void carry();

  std::vector<uint8_t> bytes_;
  uint64_t low_ = 0;
  uint64_t range_ = ~uint64_t{0};
};

/// Reads zeros after the end of `bytes`; overran() reports it.
class RangeDecoder {
 public:
  explicit RangeDecoder(std::span<const uint8_t> bytes) : bytes_(bytes) {
    code_ = uint64_t{next_word()} << 32;
    code_ |= next_word();
  }

  bool bit(BitModel& model, bool = false) {
    const bool value = split((range_ >> 16) * model.zero());
    model.learn(value);
    return value;
  }
  bool even_bit(bool = false) { return split(range_ >> 1); }

  /// True when more was decoded than the bytes can hold, so that the result is invalid. (A decoder
  /// reads up to 7 bytes more than an encoder writes.)
  bool overran() const { return at_ > bytes_.size() + 7; }
  /// True when all bytes were read and overran() is false.
  bool ended() const { return at_ >= bytes_.size() && !overran(); }

 private:
  bool split(uint64_t zero) {
    const bool value = code_ >= zero;
    code_ -= value ? zero : 0;
    range_ = value ? range_ - zero : zero;
    if (range_ < uint64_t{1} << 32) {
      range_ <<= 32;
      code_ = code_ << 32 | next_word();
    }
    return value;
  }
  // Inline, so that a copy of the decoder can stay in registers.
  uint32_t next_word() {
    uint32_t word = 0;
    for (size_t n = at_; n < at_ + 4; ++n) word = word << 8 | (n < bytes_.size() ? bytes_[n] : 0);
    at_ += 4;
    return word;
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  uint64_t code_ = 0;
  uint64_t range_ = ~uint64_t{0};
};

/// A number from 0, mostly small. The digits of number + 1 after its highest one are counted by
/// adaptive bits; the digits themselves are even bits (Exp-Golomb).
class NumberModel {
 public:
  /// Maximum number of digits. Numbers up to 2^(kMaxDigits + 1) - 2 are coded.
  static constexpr int kMaxDigits = 24;

  template <class Coder>
  uint32_t code(Coder& coder, uint32_t number) {
    const int wanted = std::bit_width(number + 1) - 1;
    int digits = 0;
    while (digits < kMaxDigits && coder.bit(more_[digits], wanted > digits)) ++digits;
    uint32_t coded = 1;
    for (int d = digits - 1; d >= 0; --d) {
      coded = coded << 1 | uint32_t{coder.even_bit(((number + 1) >> d & 1) != 0)};
    }
    return coded - 1;
  }

 private:
  std::array<BitModel, kMaxDigits> more_;
};

/// An integer that is mostly near 0: a bit for 0, the sign, then 1s for the magnitude. From kUnary
/// on, the excess is coded as a NumberModel.
class ResidualModel {
 public:
  static constexpr int kUnary = 14;
  /// Numbers from -kMaxMagnitude to kMaxMagnitude are coded.
  static constexpr int kMaxMagnitude = 1 << 20;

  template <class Coder>
  int code(Coder& coder, int value) {
    return code(coder, value, [&](bool negative) { return coder.even_bit(negative); });
  }
  /// `sign(negative)` codes the sign.
  template <class Coder, class Sign>
  int code(Coder& coder, int value, const Sign& sign) {
    if (!coder.bit(nonzero_, value != 0)) return 0;
    const bool negative = sign(value < 0);
    const int wanted = value < 0 ? -value : value;
    int magnitude = 1;
    while (magnitude < kUnary && coder.bit(more_[magnitude - 1], wanted > magnitude)) ++magnitude;
    if (magnitude == kUnary) {
      const int excess = wanted > kUnary ? wanted - kUnary : 0;
      magnitude += static_cast<int>(excess_.code(coder, static_cast<uint32_t>(excess)));
    }
    return negative ? -magnitude : magnitude;
  }

 private:
  BitModel nonzero_;
  std::array<BitModel, kUnary - 1> more_;
  NumberModel excess_;
};

// Range asymmetric numeral systems (rANS) coder for symbols of known frequency. The symbol that is
// encoded last is decoded first. docs/compact-frame.md is normative.
// Source: Duda, "Asymmetric numeral systems", arXiv:1311.2540; its range variant.

/// All symbols share kSlots slots: a symbol with n slots costs log2(kSlots / n) bits.
inline constexpr int kSlotBits = 10;
inline constexpr uint32_t kSlots = 1U << kSlotBits;

/// First state of the encoder and last state of the decoder. States are at least this and below
/// 2^32 times this.
inline constexpr uint64_t kRansStart = uint64_t{1} << 31;

/// Division by a constant through a multiplication, which is faster. Exact for dividends below
/// 2^63. Source: Granlund and Montgomery, "Division by invariant integers using multiplication",
/// 1994.
class Reciprocal {
 public:
  constexpr Reciprocal() = default;
  /// Requires 0 < divisor <= 2^32.
  constexpr explicit Reciprocal(uint64_t divisor)
      : shift_(63 + std::bit_width(divisor - 1)),
        factor_(static_cast<uint64_t>((Product{1} << shift_) / divisor + 1)) {}
  constexpr uint64_t quotient_of(uint64_t dividend) const {
    return static_cast<uint64_t>(Product{dividend} * factor_ >> shift_);
  }

 private:
  __extension__ using Product = unsigned __int128;
  int shift_ = 0;
  uint64_t factor_ = 0;
};

class RansEncoder {
 public:
  /// Encodes a symbol whose slots start at `first`. Requires 0 < slots and first + slots <= kSlots.
  void put(uint32_t first, uint32_t slots) {
    if (state_ >= (kRansStart >> kSlotBits << 32) * slots) {
      words_.push_back(static_cast<uint32_t>(state_));
      state_ >>= 32;
    }
    const uint64_t quotient = kReciprocals[slots].quotient_of(state_);
    state_ = (quotient << kSlotBits) + (state_ - quotient * slots) + first;
  }
  /// Appends the bytes for the decoder.
  void finish(ByteWriter& bytes) const;

 private:
  static constexpr std::array<Reciprocal, kSlots + 1> kReciprocals = [] {
    std::array<Reciprocal, kSlots + 1> reciprocals;
    for (uint32_t slots = 1; slots <= kSlots; ++slots) reciprocals[slots] = Reciprocal(slots);
    return reciprocals;
  }();

  uint64_t state_ = kRansStart;
  std::vector<uint32_t> words_;
};

/// Reads zeros after the end of `bytes`; ended() reports it.
class RansDecoder {
 public:
  explicit RansDecoder(std::span<const uint8_t> bytes);

  /// Slot of the next symbol: the index into a SlotTable.
  uint32_t slot() const { return static_cast<uint32_t>(state_) & (kSlots - 1); }
  /// Removes a symbol with `slots` slots from the state. `place`: position of slot() within these
  /// slots, from 0.
  void take(uint32_t slots, uint32_t place) {
    state_ = slots * (state_ >> kSlotBits) + place;
    if (state_ < kRansStart) state_ = state_ << 32 | next_word();
  }
  /// True when all bytes were read and the state is that of a complete stream.
  bool ended() const { return valid_ && at_ == bytes_.size() && state_ == kRansStart; }

 private:
  uint32_t next_word() {
    uint32_t word = 0;
    if (at_ + sizeof(word) <= bytes_.size()) std::memcpy(&word, &bytes_[at_], sizeof(word));
    at_ += sizeof(word);
    return word;
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  uint64_t state_ = 0;
  bool valid_ = true;
};

// Frequency table of 256 symbols, in slots of a RansDecoder. It is transmitted before the symbols.

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

}  // namespace v3d::codec
