// Range asymmetric numeral systems (rANS) coder for symbols of known frequency. The symbol that is
// encoded last is decoded first. docs/compact-frame.md is normative.
// Source: Duda, "Asymmetric numeral systems", arXiv:1311.2540; its range variant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "codec/byte_stream.h"

namespace v3d {

/// All symbols share kSlots slots: a symbol with n slots costs log2(kSlots / n) bits.
inline constexpr int kSlotBits = 10;
inline constexpr uint32_t kSlots = 1U << kSlotBits;

/// First state of the encoder and last state of the decoder. States are at least this and below
/// 2^32 times this.
inline constexpr uint64_t kRansStart = uint64_t{1} << 31;

class RansEncoder {
 public:
  /// Encodes a symbol whose slots start at `first`. Requires 0 < slots and first + slots <= kSlots.
  void put(uint32_t first, uint32_t slots) {
    if (state_ >= (kRansStart >> kSlotBits << 32) * slots) {
      words_.push_back(static_cast<uint32_t>(state_));
      state_ >>= 32;
    }
    state_ = (state_ / slots << kSlotBits) + state_ % slots + first;
  }
  /// Appends the bytes for the decoder.
  void finish(ByteWriter& bytes) const;

 private:
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

}  // namespace v3d
