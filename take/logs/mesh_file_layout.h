// Binary layout of mesh.v3d (docs/compact-frame.md). All numbers are little-endian.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "codec/byte_stream.h"

namespace v3d::take::mesh_file {

using Magic8 = std::array<uint8_t, 8>;
using Magic4 = std::array<uint8_t, 4>;
inline constexpr Magic8 kFileMagic = {'V', '3', 'D', 'M', '\r', '\n', 0x1A, '\n'};
inline constexpr Magic8 kFooterMagic = {'V', '3', 'D', 'E', '\r', '\n', 0x1A, '\n'};
inline constexpr Magic4 kRecordMagic = {'V', '3', 'D', 'R'};
inline constexpr Magic4 kIndexMagic = {'V', '3', 'D', 'I'};
inline constexpr Magic8 kFrameMagic = {'V', '3', 'D', 'F', '\r', '\n', 0x1A, '\n'};
inline constexpr uint32_t kVersion = 1;

inline constexpr size_t kHeaderSize = 16;
inline constexpr size_t kRecordSize = 24;  ///< without the payload
inline constexpr size_t kIndexHeadSize = 8;
inline constexpr size_t kEntrySize = 24;
inline constexpr size_t kFooterSize = 24;
inline constexpr size_t kFramePulse = 24;  ///< offset of the pulse in a compact frame
inline constexpr uint32_t kMaxPayload = 268'435'456;
/// Limit of the index, bytes: 2.8 million meshes. Readers ignore a longer index and rebuild it from
/// the records.
inline constexpr uint32_t kMaxIndex = 64 << 20;

/// The index entry of one record.
struct Entry {
  int64_t pulse = 0;
  uint64_t offset = 0;  ///< bytes from the start of the file to the record
  uint32_t payload_size = 0;
  uint32_t payload_crc = 0;
};

class Writer {
 public:
  template <size_t N>
  void magic(const std::array<uint8_t, N>& bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void u32(uint32_t n) { little_endian(n, 4); }
  void u64(uint64_t n) { little_endian(n, 8); }
  const std::vector<uint8_t>& bytes() const { return bytes_; }

 private:
  void little_endian(uint64_t n, int bytes) {
    for (int i = 0; i < bytes; ++i) bytes_.push_back(static_cast<uint8_t>(n >> (8 * i)));
  }
  std::vector<uint8_t> bytes_;
};

inline uint64_t little_endian(const uint8_t* p, int bytes) {
  uint64_t n = 0;
  for (int i = bytes - 1; i >= 0; --i) n = n << 8 | p[i];
  return n;
}
inline uint32_t u32_at(std::span<const uint8_t> bytes, size_t at) {
  return static_cast<uint32_t>(little_endian(bytes.data() + at, 4));
}
inline uint64_t u64_at(std::span<const uint8_t> bytes, size_t at) {
  return little_endian(bytes.data() + at, 8);
}
template <size_t N>
bool magic_at(std::span<const uint8_t> bytes, size_t at, const std::array<uint8_t, N>& magic) {
  return at + N <= bytes.size() && std::memcmp(bytes.data() + at, magic.data(), N) == 0;
}

/// Whether a payload is the compact frame of another pulse. False for other bytes, which no decoder
/// accepts.
inline bool is_of_other_pulse(std::span<const uint8_t> payload, int64_t pulse) {
  return magic_at(payload, 0, kFrameMagic) && payload.size() >= kFramePulse + 8 &&
         u64_at(payload, kFramePulse) != static_cast<uint64_t>(pulse);
}

inline std::vector<uint8_t> header() {
  Writer w;
  w.magic(kFileMagic);
  w.u32(kVersion);
  w.u32(0);
  return w.bytes();
}

inline std::vector<uint8_t> record_head(const Entry& entry) {
  Writer w;
  w.magic(kRecordMagic);
  w.u32(entry.payload_size);
  w.u64(static_cast<uint64_t>(entry.pulse));
  w.u32(entry.payload_crc);
  w.u32(codec::crc32(w.bytes()));
  return w.bytes();
}

/// Decodes the head of a record. Empty when its checksum is wrong or its numbers are impossible.
inline std::optional<Entry> read_record_head(std::span<const uint8_t> head, uint64_t offset) {
  if (head.size() < kRecordSize || !magic_at(head, 0, kRecordMagic)) return std::nullopt;
  if (codec::crc32(head.first(kRecordSize - 4)) != u32_at(head, kRecordSize - 4))
    return std::nullopt;
  const Entry entry{.pulse = static_cast<int64_t>(u64_at(head, 8)),
                    .offset = offset,
                    .payload_size = u32_at(head, 4),
                    .payload_crc = u32_at(head, 16)};
  if (entry.pulse < 0 || entry.payload_size > kMaxPayload) return std::nullopt;
  return entry;
}

/// Encodes index and footer, for a file where the index starts at `offset`.
inline std::vector<uint8_t> index(const std::vector<Entry>& entries, uint64_t offset) {
  Writer w;
  w.magic(kIndexMagic);
  w.u32(static_cast<uint32_t>(entries.size()));
  for (const Entry& entry : entries) {
    w.u64(static_cast<uint64_t>(entry.pulse));
    w.u64(entry.offset);
    w.u32(entry.payload_size);
    w.u32(entry.payload_crc);
  }
  const auto size = static_cast<uint32_t>(w.bytes().size());
  const uint32_t crc = codec::crc32(w.bytes());
  w.u64(offset);
  w.u32(size);
  w.u32(crc);
  w.magic(kFooterMagic);
  return w.bytes();
}

}  // namespace v3d::take::mesh_file
