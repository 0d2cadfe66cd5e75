// The first bytes of a compact frame of version 2: docs/compact-frame.md.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace v3d {

struct FrameLimits {
  static constexpr uint32_t kVertices = 1U << 22;
  static constexpr uint32_t kTriangles = 1U << 23;
  static constexpr int kCameras = 256;
  static constexpr int kNameBytes = 64;
  static constexpr int kSubdivision = 64;
};

/// What a frame says of itself.
struct FrameFacts {
  int64_t pulse = 0;
  int64_t exposure_ns = 0;           ///< start, CLOCK_REALTIME of the trigger's node; 0: unknown
  std::vector<std::string> cameras;  ///< that took part, ascending
  int missing = 0;                   ///< cameras of the rig that did not
  float quality =
      std::numeric_limits<float>::quiet_NaN();  ///< 0 to 1, more is better; NaN: unknown
  std::array<double, 3> origin{};               ///< of the lattice: world, metres
  double step = 0;                              ///< of the lattice, metres
};

struct FrameHeader {
  static constexpr size_t kBytes = 128;
  static constexpr uint16_t kColours = 1, kDisplaced = 2, kInter = 4, kExplicit = 8;

  FrameFacts facts;  ///< without the names of the cameras
  uint16_t cameras = 0;
  uint16_t flags = 0;
  uint16_t subdivision = 1;  ///< lattice steps in half a voxel
  int64_t key_pulse = 0;
  uint32_t reference = 0;  ///< the checksum of the frame before; 0 in a key frame
  uint32_t checksum = 0;   ///< when read
  std::array<uint8_t, 3> colour_steps{};
  uint32_t vertices = 0;
  uint32_t triangles = 0;
  std::array<uint16_t, 3> first_brick{};
  std::array<uint16_t, 3> bricks{};
  /// Names, shape, displacements, colours: so many bytes each.
  std::array<uint32_t, 4> section_bytes{};

  bool is(uint16_t flag) const { return (flags & flag) != 0; }
};

enum Section { kNames, kShape, kDisplacements, kColours };
using Sections = std::array<std::vector<uint8_t>, 4>;

/// The whole compact frame, with its checksum; sets header.checksum and section_bytes.
std::vector<uint8_t> write_frame(FrameHeader& header, const Sections& sections);

/// Empty unless every rule that needs the header alone holds and the checksum is right.
std::optional<FrameHeader> read_header(std::span<const uint8_t> bytes);
/// Requires the bytes that `header` was read from.
std::span<const uint8_t> section(std::span<const uint8_t> bytes, const FrameHeader& header,
                                 Section section);

std::vector<uint8_t> encode_names(const std::vector<std::string>& names);
std::optional<std::vector<std::string>> decode_names(std::span<const uint8_t> bytes, int count);

}  // namespace v3d
