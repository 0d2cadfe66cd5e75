// Checksums against damage on the way to a disk and back: XXH3 with 64 bits, which costs less than
// the copy. The adapter of xxHash.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>

namespace v3d {

/// XXH3, 64 bits, seed 0, of the parts as if they stood one behind the other.
uint64_t checksum(std::initializer_list<std::span<const uint8_t>> parts);

}  // namespace v3d
