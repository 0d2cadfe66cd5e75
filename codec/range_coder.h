// Adaptive binary arithmetic coding: bits in, bytes out, and back. docs/compact-frame.md has the
// normative description.
//
// A code_...() function takes either coder and does the same with both; so it is written once, and
// what is decoded is what was encoded. bit(model, value) of the encoder codes `value` and returns
// it, that of the decoder ignores `value` and returns what was coded.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

namespace v3d {

/// How likely a bit is 0, learnt from the bits before: fast at first, slowly later.
class BitModel {
 public:
  /// Of 0, in 65536ths; 32 to 65504, so every bit costs something and no bit more than 11 bits.
  uint32_t zero() const { return zero_; }

  void learn(bool bit) {
    const int shift = kShifts[count_];
    const int target = bit ? kLeast : kMost;
    zero_ = static_cast<uint16_t>(zero_ + ((target - zero_) >> shift));
    count_ = static_cast<uint16_t>(count_ + (count_ < kShifts.size() - 1));
  }

 private:
  static constexpr int kLeast = 32;
  static constexpr int kMost = 65536 - 32;
  static constexpr std::array<uint8_t, 24> kShifts{1, 2, 2, 3, 3, 3, 4, 4, 4, 4, 4, 4,
                                                   5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6};
  uint16_t zero_ = 32768;
  uint16_t count_ = 0;  ///< bits learnt from, as far as kShifts reaches
};

class RangeEncoder {
 public:
  bool bit(BitModel& model, bool value) {
    split((range_ >> 16) * model.zero(), value);
    model.learn(value);
    return value;
  }
  /// As likely 0 as 1.
  bool even_bit(bool value) {
    split(range_ >> 1, value);
    return value;
  }
  /// All bytes; begins anew.
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

/// Never reads beyond `bytes`: behind their end are zeros, and overran() tells.
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

  /// More was decoded than the bytes can hold: what came out is not what was encoded. (An encoder
  /// leaves at most the last 7 bytes that a decoder reads to the zeros.)
  bool overran() const { return at_ > bytes_.size() + 7; }
  /// Everything was read, and no more than there is.
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
  // Here and without a call, so that a copy of the decoder can live in registers.
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

/// A whole number from 0 on, mostly small: the digits of number + 1 behind its highest one are
/// counted by bits that are learnt; they themselves are even bits (Exp-Golomb).
class NumberModel {
 public:
  /// Numbers below 2^kMostDigits are coded.
  static constexpr int kMostDigits = 24;

  template <class Coder>
  uint32_t code(Coder& coder, uint32_t number) {
    const int wanted = std::bit_width(number + 1) - 1;
    int digits = 0;
    while (digits < kMostDigits && coder.bit(more_[digits], wanted > digits)) ++digits;
    uint32_t coded = 1;
    for (int d = digits - 1; d >= 0; --d) {
      coded = coded << 1 | uint32_t{coder.even_bit(((number + 1) >> d & 1) != 0)};
    }
    return coded - 1;
  }

 private:
  std::array<BitModel, kMostDigits> more_;
};

/// A whole number that is mostly near 0: is it 0, its sign, then 1s for its magnitude, and from
/// kUnary on the rest as a NumberModel.
class ResidualModel {
 public:
  static constexpr int kUnary = 14;
  /// Numbers from -kMost to kMost are coded.
  static constexpr int kMost = 1 << 20;

  template <class Coder>
  int code(Coder& coder, int value) {
    if (!coder.bit(nonzero_, value != 0)) return 0;
    const bool negative = coder.even_bit(value < 0);
    const int wanted = value < 0 ? -value : value;
    int magnitude = 1;
    while (magnitude < kUnary && coder.bit(more_[magnitude - 1], wanted > magnitude)) ++magnitude;
    if (magnitude == kUnary) {
      const int rest = wanted > kUnary ? wanted - kUnary : 0;
      magnitude += static_cast<int>(rest_.code(coder, static_cast<uint32_t>(rest)));
    }
    return negative ? -magnitude : magnitude;
  }

 private:
  BitModel nonzero_;
  std::array<BitModel, kUnary - 1> more_;
  NumberModel rest_;
};

}  // namespace v3d
