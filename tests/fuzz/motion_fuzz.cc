// Fuzz target: motion files. Each is rejected, or gives valid surfaces and pulses. The target
// corrects the checksums, as an attacker would.
#include <algorithm>
#include <cstring>
#include <vector>

#include "codec/byte_stream.h"
#include "codec/motion_codec.h"
#include "codec/motion_header.h"
#include "fuzz_input.h"

namespace {

using v3d::codec::crc32;
using v3d::codec::MotionSegmentHeader;
using v3d::codec::MotionTableEntry;
using v3d::test::must;

constexpr size_t kChecksum = 4, kChecked = 8, kBytes = 8, kPulses = 16, kTemplateChecksum = 44;
constexpr size_t kSections = 48;

template <class T>
T get(const std::vector<uint8_t>& file, size_t at) {
  T number{};
  std::memcpy(&number, &file[at], sizeof number);
  return number;
}
template <class T>
void put(std::vector<uint8_t>& file, size_t at, T number) {
  std::memcpy(&file[at], &number, sizeof number);
}

/// Corrects the checksums of the segment at `segment`. Returns where the next one begins, 0 when
/// the segment is not whole.
size_t correct(std::vector<uint8_t>& file, size_t segment) {
  if (file.size() - segment < MotionSegmentHeader::kBytes) return 0;
  const size_t room = file.size() - segment;
  const size_t pulses = get<uint32_t>(file, segment + kPulses);
  if (pulses > room / MotionTableEntry::kBytes) return 0;
  const size_t header = MotionSegmentHeader::kBytes + MotionTableEntry::kBytes * pulses;
  if (header > room) return 0;
  size_t at = segment + header;
  const auto checksum = [&](size_t bytes) {
    bytes = std::min(bytes, file.size() - at);
    const uint32_t sum = crc32(std::span(file).subspan(at, bytes));
    at += bytes;
    return sum;
  };
  size_t sections = 0;
  for (size_t n = 0; n < 3; ++n) sections += get<uint32_t>(file, segment + kSections + 4 * n);
  put(file, segment + kTemplateChecksum, checksum(sections));
  for (size_t p = 0; p < pulses; ++p) {
    const size_t entry = segment + MotionSegmentHeader::kBytes + MotionTableEntry::kBytes * p;
    put(file, entry + 12, checksum(get<uint32_t>(file, entry + 8)));
  }
  put(file, segment + kBytes, uint64_t{at - segment});
  put(file, segment + kChecksum,
      crc32(std::span(file).subspan(segment + kChecked, header - kChecked)));
  return at;
}

void check(v3d::codec::MotionReader& reader, size_t segment) {
  const v3d::codec::MotionSegmentInfo& info = reader.segments()[segment];
  const v3d::codec::MotionTemplate* surface = reader.surface(segment);
  if (surface == nullptr) return;
  must(surface->positions.size() == info.vertices && surface->triangles.size() == info.triangles);
  for (const auto& triangle : surface->triangles) {
    for (const uint32_t vertex : triangle) must(vertex < info.vertices);
  }
  // The last pulse first: it needs others.
  for (size_t n = 0; n < std::min<size_t>(info.pulses.size(), 20); ++n) {
    const auto* pulse = reader.decode(segment, info.pulses.size() - 1 - n);
    if (pulse == nullptr) continue;
    must(pulse->positions.size() == info.vertices);
    must(pulse->colours.size() == (info.coloured ? info.vertices : 0));
    must(pulse->confidences.size() == (info.has_confidences ? info.vertices : 0));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> file(data, data + size);
  size_t at = v3d::codec::kMotionFileHeaderBytes;
  for (int n = 0; n < 4 && at > 0 && at < file.size(); ++n) at = correct(file, at);
  auto reader = v3d::codec::MotionReader::open(file);
  if (!reader) return 0;
  for (size_t s = 0; s < std::min<size_t>(reader->segments().size(), 4); ++s) check(*reader, s);
  return 0;
}
