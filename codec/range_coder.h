// Adaptive binary range coder. docs/compact-frame.md is normative.
//
// Functions code() accept the encoder or the decoder, so that one implementation serves both.
// bit(model, value) of the encoder codes `value` and returns it. bit() of the decoder ignores
// `value` and returns the decoded bit.
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
    if (!coder.bit(nonzero_, value != 0)) return 0;
    const bool negative = coder.even_bit(value < 0);
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

}  // namespace v3d
