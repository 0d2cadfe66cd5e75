// Header of a compact frame of version 2 to 5 (docs/compact-frame.md).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::codec {

struct FrameLimits {
  static constexpr uint32_t kVertices = 1U << 22;
  static constexpr uint32_t kTriangles = 1U << 23;
  static constexpr int kCameras = 256;
  static constexpr int kNameBytes = 64;
  static constexpr int kSubdivision = 64;
  static constexpr int kPasses = 3;
  static constexpr uint64_t kCameraColours = 1U << 24;  ///< vertices times cameras
};

/// Metadata of a frame.
struct FrameMetadata {
  int64_t pulse = 0;
  /// Start of exposure, ns, CLOCK_REALTIME of the trigger's node; 0: unknown.
  int64_t exposure_ns = 0;
  std::vector<std::string> cameras;  ///< names of the cameras that took part, ascending
  /// Those of `cameras` whose image of the next pulse was used, because they are a pulse late;
  /// ascending.
  std::vector<std::string> late_cameras{};
  int missing = 0;  ///< number of cameras of the rig that did not take part
  float quality =
      std::numeric_limits<float>::quiet_NaN();  ///< 0 to 1, more is better; NaN: unknown
  std::array<double, 3> origin{};               ///< origin of the lattice, world frame, metres
  double step = 0;                              ///< step of the lattice, metres
  /// Passes of the deformation within the live budget; 0: none, or another deformation.
  int live_passes = 0;
};

struct FrameHeader {
  static constexpr size_t kBytes = 128;
  static constexpr uint16_t kColours = 1, kDisplaced = 2, kInter = 4, kExplicit = 8, kLabelled = 16,
                            kCameras = 32, kLate = 64;

  FrameMetadata metadata;  ///< without the names of the cameras
  uint16_t cameras = 0;
  uint16_t flags = 0;
  uint16_t subdivision = 1;  ///< lattice steps in half a voxel
  int64_t key_pulse = 0;
  uint32_t reference = 0;  ///< checksum of the previous frame; 0 in a key frame
  uint32_t checksum = 0;   ///< set when the header is read or written
  std::array<uint8_t, 3> colour_steps{};
  uint32_t vertices = 0;
  uint32_t triangles = 0;
  std::array<uint16_t, 3> first_brick{};
  std::array<uint16_t, 3> bricks{};
  /// Sizes of the first four sections, bytes. The others are the rest of the frame.
  std::array<uint32_t, 4> section_bytes{};
  uint32_t label_bytes = 0;  ///< size of the section of labels

  bool is(uint16_t flag) const { return (flags & flag) != 0; }
};

enum Section { kNames, kShape, kDisplacements, kColours, kLabels, kCameras };
using Sections = std::array<std::vector<uint8_t>, 6>;

/// Returns the whole compact frame with its checksum. Sets header.checksum and the sizes of
/// sections.
std::vector<uint8_t> write_frame(FrameHeader& header, const Sections& sections);

/// Empty unless all rules that involve only the header hold and the checksum is right.
std::optional<FrameHeader> read_header(std::span<const uint8_t> bytes);
/// Returns the bytes of a section. Requires the bytes from which `header` was read.
std::span<const uint8_t> section(std::span<const uint8_t> bytes, const FrameHeader& header,
                                 Section section);

/// The first rule of a frame that `metadata` breaks: the field and what would be right. Null: none.
const char* metadata_error(const FrameMetadata& metadata);

/// Whether a camera may have this name: 1 to FrameLimits::kNameBytes characters of printable ASCII.
bool name_is_valid(std::string_view name);
/// Section of the names of metadata.cameras, marked where they are in metadata.late_cameras.
std::vector<uint8_t> encode_names(const FrameMetadata& metadata);
/// Sets the names in the metadata of `header`. False unless the bytes are exactly header.cameras
/// valid names in ascending order, of which some are marked if and only if the header has kLate.
bool decode_names(std::span<const uint8_t> bytes, FrameHeader& header);

/// The metadata of a frame, whether or not it can be decoded alone. Empty for a malformed header or
/// malformed names.
std::optional<FrameMetadata> read_metadata(std::span<const uint8_t> bytes);

}  // namespace v3d::codec
