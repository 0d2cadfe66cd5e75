// Headers of the motion file, and which pulses predict a pulse. docs/motion-format.md is normative.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/colour_code.h"

namespace v3d::codec {

struct MotionLimits {
  static constexpr uint32_t kVertices = 1U << 19;
  static constexpr uint32_t kTriangles = 1U << 20;
  static constexpr uint32_t kPulses = 1U << 16;
  static constexpr uint32_t kPeriod = 256;
  static constexpr size_t kSegments = 1U << 16;
  /// Length of a file that the programs read: they need it in memory. Not a limit of the format.
  static constexpr uint64_t kFileBytes = uint64_t{1} << 30;
  static constexpr double kMinStep = 1e-9, kMaxStep = 1;  ///< metres
  static constexpr double kMaxOrigin = 1e6;               ///< metres, along each axis
};

inline constexpr size_t kMotionFileHeaderBytes = 16;
std::vector<uint8_t> motion_file_header();
bool is_motion_file_header(std::span<const uint8_t> bytes);

/// A pulse in the table of a segment.
struct MotionTableEntry {
  static constexpr size_t kBytes = 16;
  int64_t pulse = 0;
  uint32_t bytes = 0;  ///< length of its record
  uint32_t checksum = 0;
};

/// Sections of the template.
enum MotionSection { kMotionTriangles, kMotionPositions, kMotionColours };

/// Header of a segment and its table.
struct MotionSegmentHeader {
  static constexpr size_t kBytes = 96;
  static constexpr uint8_t kColoured = 1, kColoursChange = 2;

  uint64_t bytes = 0;  ///< of the whole segment
  uint32_t key = 0;    ///< index of the pulse that became the template
  uint32_t period = 1;
  uint32_t vertices = 0;
  uint32_t triangles = 0;
  uint8_t flags = 0;
  uint8_t confidence_levels = 0;  ///< 0: no confidences
  ColourSteps colour_steps{};
  uint32_t template_checksum = 0;
  std::array<uint32_t, 3> section_bytes{};
  double step = 0;                 ///< metres
  std::array<double, 3> origin{};  ///< world, metres
  std::vector<MotionTableEntry> table;

  bool is(uint8_t flag) const { return (flags & flag) != 0; }
  /// Length of header and table.
  size_t header_bytes() const { return kBytes + MotionTableEntry::kBytes * table.size(); }
  uint64_t template_bytes() const {
    return uint64_t{section_bytes[0]} + section_bytes[1] + section_bytes[2];
  }
};

/// Returns header and table with their checksum.
std::vector<uint8_t> write_motion_segment_header(const MotionSegmentHeader& header);
/// Reads the header at the front of `bytes`, which begin with a segment. Empty unless all rules
/// hold and the segment lies inside `bytes`.
std::optional<MotionSegmentHeader> read_motion_segment_header(std::span<const uint8_t> bytes);

/// Indices of the pulses that predict pulse `index`, the nearest first: up to four. None for a
/// pulse that the template predicts. Requires index < pulses.
std::vector<uint32_t> motion_references(uint32_t index, uint32_t pulses, uint32_t period);

}  // namespace v3d::codec
