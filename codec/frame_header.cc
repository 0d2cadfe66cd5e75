#include "codec/frame_header.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "codec/byte_stream.h"
#include "codec/colour_code.h"
#include "codec/occupancy.h"

namespace v3d::codec {
namespace {

constexpr std::array<uint8_t, 8> kMagic{'V', '3', 'D', 'F', 0x0D, 0x0A, 0x1A, 0x0A};
/// The first version that has FrameMetadata::live_passes and labels.
constexpr uint16_t kWithPasses = 3;
/// The first version that has the colours of cameras.
constexpr uint16_t kWithCameras = 4;
/// The first version that has FrameMetadata::late_cameras.
constexpr uint16_t kWithLate = 5;
constexpr uint16_t kOldest = 2, kNewest = kWithLate;
/// In the length of a name: the camera is late.
constexpr uint8_t kLateName = 0x80;
constexpr size_t kChecked = 16;  // the checksum covers everything from here

template <class Array>
void write_all(ByteWriter& out, const Array& numbers) {
  for (const auto number : numbers) out.number(number);
}
template <class Array>
void read_all(ByteReader& in, Array& numbers) {
  for (auto& number : numbers) number = in.number<typename Array::value_type>();
}

/// Writes the fields from kChecked on.
void write_checked_fields(ByteWriter& out, const FrameHeader& h) {
  out.number(h.flags);
  out.number(h.cameras);
  out.number(static_cast<uint16_t>(h.metadata.missing));
  out.number(h.subdivision);
  out.number(h.metadata.pulse);
  out.number(h.metadata.exposure_ns);
  out.number(h.key_pulse);
  out.number(h.reference);
  out.number(h.metadata.quality);
  write_all(out, h.metadata.origin);
  out.number(h.metadata.step);
  write_all(out, h.colour_steps);
  out.number(static_cast<uint8_t>(h.metadata.live_passes));
  out.number(h.vertices);
  out.number(h.triangles);
  write_all(out, h.first_brick);
  write_all(out, h.bricks);
  write_all(out, h.section_bytes);
}

/// Reads the fields from kChecked on.
void read_checked_fields(ByteReader& in, FrameHeader& h) {
  h.flags = in.number<uint16_t>();
  h.cameras = in.number<uint16_t>();
  h.metadata.missing = in.number<uint16_t>();
  h.subdivision = in.number<uint16_t>();
  h.metadata.pulse = in.number<int64_t>();
  h.metadata.exposure_ns = in.number<int64_t>();
  h.key_pulse = in.number<int64_t>();
  h.reference = in.number<uint32_t>();
  h.metadata.quality = in.number<float>();
  read_all(in, h.metadata.origin);
  h.metadata.step = in.number<double>();
  read_all(in, h.colour_steps);
  h.metadata.live_passes = in.number<uint8_t>();
  h.vertices = in.number<uint32_t>();
  h.triangles = in.number<uint32_t>();
  read_all(in, h.first_brick);
  read_all(in, h.bricks);
  read_all(in, h.section_bytes);
}

bool flags_are_valid(const FrameHeader& h) {
  constexpr unsigned kKnown = FrameHeader::kColours | FrameHeader::kDisplaced |
                              FrameHeader::kInter | FrameHeader::kExplicit |
                              FrameHeader::kLabelled | FrameHeader::kCameras | FrameHeader::kLate;
  // Without a volume, vertices have no lattice edges that identify them in the previous frame.
  const bool explicit_key = !h.is(FrameHeader::kExplicit) ||
                            (!h.is(FrameHeader::kDisplaced) && !h.is(FrameHeader::kInter));
  const bool coloured =
      !h.is(FrameHeader::kInter | FrameHeader::kCameras) || h.is(FrameHeader::kColours);
  return (h.flags & ~kKnown) == 0 && explicit_key && coloured;
}

/// As metadata_error(), without the names.
const char* number_error(const FrameMetadata& f) {
  const bool finite = std::all_of(f.origin.begin(), f.origin.end(),
                                  [](double metres) { return std::isfinite(metres); });
  if (f.pulse < 0) return "pulse: expected at least 0";
  if (f.missing < 0 || f.missing > FrameLimits::kCameras) return "missing: expected 0 to 256";
  if (f.quality < 0 || f.quality > 1) return "quality: expected 0 to 1";  // or not a number
  if (!finite) return "origin: expected finite numbers";
  if (!std::isfinite(f.step) || f.step <= 0) return "step: expected a finite number greater than 0";
  if (f.live_passes < 0 || f.live_passes > FrameLimits::kPasses) {
    return "live_passes: expected 0 to 3";
  }
  return nullptr;
}

bool box_is_valid(const FrameHeader& h) {
  for (int axis = 0; axis < 3; ++axis) {
    if (h.first_brick[axis] + h.bricks[axis] > Occupancy::kMaxAlongAxis) return false;
  }
  return Occupancy::box_fits({h.bricks[0], h.bricks[1], h.bricks[2]});
}

bool colours_are_valid(const FrameHeader& h) {
  const bool coloured = h.is(FrameHeader::kColours);
  return std::all_of(h.colour_steps.begin(), h.colour_steps.end(), [&](uint8_t step) {
    return coloured ? step >= 1 && step <= kMaxColourStep : step == 0;
  });
}

/// End of the first four sections.
uint64_t end_of_first(const FrameHeader& h) {
  uint64_t sum = FrameHeader::kBytes;
  for (const uint32_t section : h.section_bytes) sum += section;
  return sum;
}

/// The bytes behind the first four sections.
bool rest_is_valid(const FrameHeader& h, uint64_t rest) {
  const bool has_labels = h.is(FrameHeader::kLabelled);
  if (!h.is(FrameHeader::kCameras)) return has_labels ? rest > 0 : rest == 0;
  return (h.label_bytes > 0) == has_labels && rest > sizeof(uint32_t) + uint64_t{h.label_bytes} &&
         uint64_t{h.vertices} * h.cameras <= FrameLimits::kCameraColours;
}

bool sections_are_valid(const FrameHeader& h, size_t bytes) {
  const uint64_t sum = end_of_first(h);
  const bool has_displacements = h.is(FrameHeader::kDisplaced) || h.is(FrameHeader::kExplicit);
  return sum <= bytes && rest_is_valid(h, bytes - sum) &&
         (h.section_bytes[kDisplacements] > 0) == has_displacements &&
         (h.section_bytes[kColours] > 0) == h.is(FrameHeader::kColours);
}

bool is_valid(const FrameHeader& h, size_t bytes) {
  const bool key = !h.is(FrameHeader::kInter);
  return flags_are_valid(h) && number_error(h.metadata) == nullptr && box_is_valid(h) &&
         colours_are_valid(h) && sections_are_valid(h, bytes) &&
         h.cameras <= FrameLimits::kCameras && h.subdivision >= 1 &&
         h.subdivision <= FrameLimits::kSubdivision && h.key_pulse >= 0 &&
         (key ? h.key_pulse == h.metadata.pulse && h.reference == 0
              : h.key_pulse < h.metadata.pulse) &&
         h.vertices <= FrameLimits::kVertices && h.triangles <= FrameLimits::kTriangles;
}

/// The lowest version that has all fields of `h`, so that older readers read what they can.
uint16_t version_of(const FrameHeader& h) {
  if (h.is(FrameHeader::kLate)) return kWithLate;
  if (h.is(FrameHeader::kCameras)) return kWithCameras;
  return h.metadata.live_passes > 0 || h.is(FrameHeader::kLabelled) ? kWithPasses : kOldest;
}

/// Sets the size of the section of labels. Any number where the frame has no such section.
void read_label_bytes(std::span<const uint8_t> bytes, FrameHeader& h) {
  const uint64_t at = end_of_first(h);
  if (at > bytes.size()) return;
  const auto rest = bytes.subspan(at);
  if (!h.is(FrameHeader::kCameras)) {
    h.label_bytes = static_cast<uint32_t>(rest.size());
  } else if (rest.size() >= sizeof(uint32_t)) {
    h.label_bytes = ByteReader(rest).number<uint32_t>();
  }
}

}  // namespace

std::vector<uint8_t> write_frame(FrameHeader& header, const Sections& sections) {
  ByteWriter body;
  for (size_t n = 0; n < header.section_bytes.size(); ++n) {
    header.section_bytes[n] = static_cast<uint32_t>(sections[n].size());
  }
  write_checked_fields(body, header);
  header.label_bytes = static_cast<uint32_t>(sections[kLabels].size());
  for (size_t n = 0; n < header.section_bytes.size(); ++n) body.bytes(sections[n]);
  if (header.is(FrameHeader::kCameras)) body.number(header.label_bytes);
  body.bytes(sections[kLabels]);
  body.bytes(sections[kCameras]);
  const std::vector<uint8_t> checked = body.take();
  header.checksum = crc32(checked);
  ByteWriter out;
  out.bytes(kMagic);
  out.number(version_of(header));
  out.number(static_cast<uint16_t>(FrameHeader::kBytes));
  out.number(header.checksum);
  out.bytes(checked);
  return out.take();
}

std::optional<FrameHeader> read_header(std::span<const uint8_t> bytes) {
  if (bytes.size() < FrameHeader::kBytes ||
      !std::equal(kMagic.begin(), kMagic.end(), bytes.begin())) {
    return std::nullopt;
  }
  ByteReader in(bytes.subspan(kMagic.size()));
  FrameHeader h;
  const auto version = in.number<uint16_t>();
  if (version < kOldest || version > kNewest || in.number<uint16_t>() != FrameHeader::kBytes) {
    return std::nullopt;
  }
  h.checksum = in.number<uint32_t>();
  read_checked_fields(in, h);
  read_label_bytes(bytes, h);
  if (version_of(h) != version || !is_valid(h, bytes.size()) ||
      crc32(bytes.subspan(kChecked)) != h.checksum) {
    return std::nullopt;
  }
  return h;
}

std::span<const uint8_t> section(std::span<const uint8_t> bytes, const FrameHeader& header,
                                 Section section) {
  size_t begin = FrameHeader::kBytes;
  for (size_t n = 0; n < std::min<size_t>(section, header.section_bytes.size()); ++n) {
    begin += header.section_bytes[n];
  }
  if (section < kLabels) return bytes.subspan(begin, header.section_bytes[section]);
  if (header.is(FrameHeader::kCameras)) begin += sizeof(header.label_bytes);
  return section == kLabels ? bytes.subspan(begin, header.label_bytes)
                            : bytes.subspan(begin + header.label_bytes);
}

bool name_is_valid(std::string_view name) {
  return !name.empty() && name.size() <= FrameLimits::kNameBytes &&
         std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

const char* metadata_error(const FrameMetadata& metadata) {
  const std::vector<std::string>& names = metadata.cameras;
  const std::vector<std::string>& late = metadata.late_cameras;
  if (names.size() > FrameLimits::kCameras) return "cameras: expected at most 256";
  if (!std::all_of(names.begin(), names.end(), name_is_valid)) {
    return "cameras: expected names of 1 to 64 characters of printable ASCII";
  }
  if (!std::is_sorted(names.begin(), names.end(), std::less_equal<>())) {
    return "cameras: expected names in ascending order, each once";
  }
  if (!std::includes(names.begin(), names.end(), late.begin(), late.end())) {
    return "late_cameras: expected some of the cameras in ascending order, each once";
  }
  return number_error(metadata);
}

std::vector<uint8_t> encode_names(const FrameMetadata& metadata) {
  std::vector<uint8_t> bytes;
  for (const std::string& name : metadata.cameras) {
    const bool late =
        std::binary_search(metadata.late_cameras.begin(), metadata.late_cameras.end(), name);
    bytes.push_back(static_cast<uint8_t>(name.size() | (late ? kLateName : 0U)));
    bytes.insert(bytes.end(), name.begin(), name.end());
  }
  return bytes;
}

bool decode_names(std::span<const uint8_t> bytes, FrameHeader& header) {
  std::vector<std::string>& names = header.metadata.cameras;
  std::vector<std::string>& late = header.metadata.late_cameras;
  names.clear();
  late.clear();
  for (int i = 0; i < header.cameras; ++i) {
    const unsigned first = bytes.empty() ? 0 : bytes[0];
    const size_t length = first & ~unsigned{kLateName};
    if (length >= bytes.size()) return false;
    names.emplace_back(reinterpret_cast<const char*>(bytes.data()) + 1, length);
    if (!name_is_valid(names.back()) || (i > 0 && !(names[i - 1] < names[i]))) return false;
    if ((first & kLateName) != 0) late.push_back(names.back());
    bytes = bytes.subspan(1 + length);
  }
  return bytes.empty() && header.is(FrameHeader::kLate) == !late.empty();
}

std::optional<FrameMetadata> read_metadata(std::span<const uint8_t> bytes) {
  std::optional<FrameHeader> header = read_header(bytes);
  if (!header || !decode_names(section(bytes, *header, kNames), *header)) return std::nullopt;
  return std::move(header->metadata);
}

}  // namespace v3d::codec
