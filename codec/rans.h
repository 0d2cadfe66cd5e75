// Symbols of known frequency in, bytes out, and back: what is encoded last is decoded first.
// docs/compact-frame.md has the normative description.
// Source: Duda, "Asymmetric numeral systems", arXiv:1311.2540; its range variant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "codec/byte_stream.h"

namespace v3d {

/// Symbols share so many slots: one that has n of them takes log2(kSlots / n) bits.
inline constexpr int kSlotBits = 10;
inline constexpr uint32_t kSlots = 1U << kSlotBits;

/// The encoder's first state and the decoder's last. States are from here to below 2^32 times this.
inline constexpr uint64_t kRansStart = uint64_t{1} << 31;

class RansEncoder {
 public:
  /// A symbol whose slots begin at `first`. Requires 0 < slots and first + slots <= kSlots.
  void put(uint32_t first, uint32_t slots) {
    if (state_ >= (kRansStart >> kSlotBits << 32) * slots) {
      words_.push_back(static_cast<uint32_t>(state_));
      state_ >>= 32;
    }
    state_ = (state_ / slots << kSlotBits) + state_ % slots + first;
  }
  /// Appends what the decoder reads.
  void finish(ByteWriter& bytes) const;

 private:
  uint64_t state_ = kRansStart;
  std::vector<uint32_t> words_;
};

/// Never reads beyond `bytes`: behind their end are zeros, and ended() tells.
class RansDecoder {
 public:
  explicit RansDecoder(std::span<const uint8_t> bytes);

  /// Where the next symbol is to be looked up.
  uint32_t slot() const { return static_cast<uint32_t>(state_) & (kSlots - 1); }
  /// It was a symbol with so many slots, and `place` is where slot() lies in these, from 0.
  void take(uint32_t slots, uint32_t place) {
    state_ = slots * (state_ >> kSlotBits) + place;
    if (state_ < kRansStart) state_ = state_ << 32 | next_word();
  }
  /// Everything was read, and all of it was an encoder's.
  bool ended() const { return sound_ && at_ == bytes_.size() && state_ == kRansStart; }

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
  bool sound_ = true;
};

}  // namespace v3d
