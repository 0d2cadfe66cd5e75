// CRC-32 checksum of IEEE 802.3, zlib and PNG.
#pragma once

#include <cstdint>
#include <span>

namespace v3d {

/// Returns 0xCBF43926 for "123456789". `before`: CRC-32 of the bytes that precede `bytes`.
uint32_t crc32(std::span<const uint8_t> bytes, uint32_t before = 0);

}  // namespace v3d
