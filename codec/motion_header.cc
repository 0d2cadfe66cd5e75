#include "codec/motion_header.h"

#include <algorithm>
#include <cmath>

#include "codec/byte_stream.h"
#include "codec/motion_pulse.h"

namespace v3d::codec {
namespace {

constexpr std::array<uint8_t, 8> kFileMagic{'V', '3', 'D', 'T', 0x0D, 0x0A, 0x1A, 0x0A};
constexpr std::array<uint8_t, 4> kSegmentMagic{'V', '3', 'D', 'S'};
constexpr uint32_t kVersion = 1;
constexpr size_t kChecked = 8;  // the checksum covers header and table from here

void write_checked_fields(ByteWriter& out, const MotionSegmentHeader& h) {
  out.number(h.bytes);
  out.number(static_cast<uint32_t>(h.table.size()));
  out.number(h.key);
  out.number(h.period);
  out.number(h.vertices);
  out.number(h.triangles);
  out.number(h.flags);
  out.number(h.confidence_levels);
  for (const uint8_t step : h.colour_steps) out.number(step);
  out.bytes(std::array<uint8_t, 3>{});
  out.number(h.template_checksum);
  for (const uint32_t bytes : h.section_bytes) out.number(bytes);
  out.number(uint32_t{0});
  out.number(h.step);
  for (const double metres : h.origin) out.number(metres);
  for (const MotionTableEntry& entry : h.table) {
    out.number(entry.pulse);
    out.number(entry.bytes);
    out.number(entry.checksum);
  }
}

/// Reads all but the table. Returns the number of its entries; empty when a reserved field is used.
std::optional<uint32_t> read_checked_fields(ByteReader& in, MotionSegmentHeader& h) {
  h.bytes = in.number<uint64_t>();
  const auto pulses = in.number<uint32_t>();
  h.key = in.number<uint32_t>();
  h.period = in.number<uint32_t>();
  h.vertices = in.number<uint32_t>();
  h.triangles = in.number<uint32_t>();
  h.flags = in.number<uint8_t>();
  h.confidence_levels = in.number<uint8_t>();
  for (uint8_t& step : h.colour_steps) step = in.number<uint8_t>();
  uint32_t reserved = 0;
  for (int n = 0; n < 3; ++n) reserved |= in.number<uint8_t>();
  h.template_checksum = in.number<uint32_t>();
  for (uint32_t& bytes : h.section_bytes) bytes = in.number<uint32_t>();
  reserved |= in.number<uint32_t>();
  h.step = in.number<double>();
  for (double& metres : h.origin) metres = in.number<double>();
  return reserved == 0 ? std::optional(pulses) : std::nullopt;
}

bool colours_are_valid(const MotionSegmentHeader& h) {
  const bool coloured = h.is(MotionSegmentHeader::kColoured);
  const bool steps = std::all_of(h.colour_steps.begin(), h.colour_steps.end(), [&](uint8_t step) {
    return coloured ? step >= 1 && step <= kMaxColourStep : step == 0;
  });
  return steps && (coloured || !h.is(MotionSegmentHeader::kColoursChange)) &&
         (h.section_bytes[kMotionColours] > 0) == coloured;
}

/// The rules that do not involve the table.
bool fields_are_valid(const MotionSegmentHeader& h) {
  constexpr unsigned kKnown = MotionSegmentHeader::kColoured | MotionSegmentHeader::kColoursChange;
  const bool near = std::all_of(h.origin.begin(), h.origin.end(), [](double metres) {
    return std::abs(metres) <= MotionLimits::kMaxOrigin;  // false for not a number
  });
  return (h.flags & ~kKnown) == 0 && h.confidence_levels != 1 &&
         h.confidence_levels <= kMaxConfidenceLevels && h.period >= 1 &&
         h.period <= MotionLimits::kPeriod && h.vertices <= MotionLimits::kVertices &&
         h.triangles <= MotionLimits::kTriangles && colours_are_valid(h) && near &&
         h.step >= MotionLimits::kMinStep && h.step <= MotionLimits::kMaxStep;
}

bool table_is_valid(const MotionSegmentHeader& h) {
  uint64_t sum = h.header_bytes() + h.template_bytes();
  int64_t last = -1;
  for (const MotionTableEntry& entry : h.table) {
    if (entry.pulse <= last) return false;
    last = entry.pulse;
    sum += entry.bytes;
  }
  return sum == h.bytes && h.key < h.table.size();
}

}  // namespace

std::vector<uint8_t> motion_file_header() {
  ByteWriter out;
  out.bytes(kFileMagic);
  out.number(kVersion);
  out.number(uint32_t{0});
  return out.take();
}

bool is_motion_file_header(std::span<const uint8_t> bytes) {
  const std::vector<uint8_t> expected = motion_file_header();
  return bytes.size() >= expected.size() &&
         std::equal(expected.begin(), expected.end(), bytes.begin());
}

std::vector<uint8_t> write_motion_segment_header(const MotionSegmentHeader& header) {
  ByteWriter checked;
  write_checked_fields(checked, header);
  const std::vector<uint8_t> fields = checked.take();
  ByteWriter out;
  out.bytes(kSegmentMagic);
  out.number(crc32(fields));
  out.bytes(fields);
  return out.take();
}

std::optional<MotionSegmentHeader> read_motion_segment_header(std::span<const uint8_t> bytes) {
  if (bytes.size() < MotionSegmentHeader::kBytes ||
      !std::equal(kSegmentMagic.begin(), kSegmentMagic.end(), bytes.begin())) {
    return std::nullopt;
  }
  ByteReader in(bytes.subspan(kSegmentMagic.size()));
  MotionSegmentHeader header;
  const auto checksum = in.number<uint32_t>();
  const auto pulses = read_checked_fields(in, header);
  if (!pulses || *pulses > MotionLimits::kPulses || header.bytes > bytes.size())
    return std::nullopt;
  const size_t length = MotionSegmentHeader::kBytes + *pulses * MotionTableEntry::kBytes;
  if (length > header.bytes || crc32(bytes.subspan(kChecked, length - kChecked)) != checksum) {
    return std::nullopt;
  }
  header.table.resize(*pulses);
  for (MotionTableEntry& entry : header.table) {
    entry.pulse = in.number<int64_t>();
    entry.bytes = in.number<uint32_t>();
    entry.checksum = in.number<uint32_t>();
  }
  if (!fields_are_valid(header) || !table_is_valid(header)) return std::nullopt;
  return header;
}

std::vector<uint32_t> motion_references(uint32_t index, uint32_t pulses, uint32_t period) {
  if (index % period == 0 || index + 1 == pulses) return {};
  uint32_t low = index - index % period;
  uint32_t high = std::min(low + period, pulses - 1);
  std::vector<uint32_t> left;  // ends of earlier intervals, the newest last
  for (uint32_t middle = (low + high) / 2; middle != index; middle = (low + high) / 2) {
    uint32_t& end = index < middle ? high : low;
    left.push_back(end);
    end = middle;
  }
  std::vector<uint32_t> references{low, high};
  for (size_t n = 0; n < left.size() && references.size() < kMaxReferences; ++n) {
    references.push_back(left[left.size() - 1 - n]);
  }
  return references;
}

}  // namespace v3d::codec
