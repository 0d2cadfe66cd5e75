// Encoder and decoder of tracked surfaces: triangles that stay, vertices that move.
// docs/motion-format.md is normative.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "codec/frame_codec.h"
#include "codec/motion_header.h"

namespace v3d::codec {

/// A surface of constant topology over several pulses.
struct MotionSegment {
  std::vector<int64_t> pulses;  ///< from 0, increasing
  size_t key = 0;               ///< index of the pulse whose mesh became the template
  std::vector<VertexTriangle> triangles;
  std::vector<std::vector<VertexPosition>> positions;  ///< [pulse][vertex], metres, world
  /// [pulse][vertex]; or one entry: constant colours; or empty.
  std::vector<std::vector<VertexColour>> colours;
  /// [pulse][vertex], from 0 (only predicted) to 255; or empty.
  std::vector<std::vector<uint8_t>> confidences;
};

struct MotionEncoderOptions {
  /// Step of the lattice of positions, metres: decoded positions differ by at most half of it along
  /// each axis.
  double step_m = 0.0005;
  ColourSteps colour_steps = kDefaultColourSteps;  ///< luma, Co, Cg
  size_t confidence_levels = 4;                    ///< 2 to 8; 0 is a level of its own
  /// Period of the pulses that only the template predicts, pulses: 1 to 256. To decode a pulse, at
  /// most two of them and log2 of the period others are decoded.
  int key_every = 25;
};

/// Numbers of bytes of the parts of a segment.
struct MotionBytes {
  size_t header = 0, triangles = 0, template_positions = 0, template_colours = 0;
  size_t positions = 0, colours = 0, confidences = 0;  ///< of all pulses
};

struct EncodedMotion {
  std::vector<uint8_t> bytes;
  /// [decoded vertex]: vertex of the input. The encoder renumbers vertices, and turns and reorders
  /// triangles.
  std::vector<uint32_t> order;
  MotionBytes parts;
};

/// Encodes a segment. Empty for content that violates MotionSegment, for invalid options, without
/// pulses, and beyond the limits: those of MotionLimits, and 2^21 steps of the lattice along an
/// axis. Deterministic.
std::optional<EncodedMotion> encode_motion(const MotionSegment& segment,
                                           const MotionEncoderOptions& options);

/// Limits of a whole motion file.
struct MotionFileLimits {
  size_t segments = MotionLimits::kSegments;
  uint64_t bytes = MotionLimits::kFileBytes;
};

/// Makes a motion file: its header, then the bytes of each segment. It writes nothing itself.
class MotionWriter {
 public:
  explicit MotionWriter(const MotionEncoderOptions& options, const MotionFileLimits& limits = {})
      : options_(options), limits_(limits) {}

  /// The first bytes of the file.
  static std::vector<uint8_t> header();
  /// Encodes the next segment; append its bytes to the file. Empty as encode_motion(), where the
  /// file has no room for it, and unless its pulses follow those of the segment before. It may
  /// begin at the last pulse of that segment, which then shows how both surfaces correspond.
  std::optional<EncodedMotion> add(const MotionSegment& segment);
  /// As add(), but first shortens `segment` to its first pulses, as many as the file has room for.
  /// If its key pulse is not one of them, the last of them becomes the key pulse. Empty also where
  /// the file has room for none.
  std::optional<EncodedMotion> add_first_pulses(MotionSegment& segment);
  /// As add(), for a segment that encode_motion() has encoded with the same options to this number
  /// of bytes. `pulses`: of the segment.
  bool add_encoded(std::span<const int64_t> pulses, size_t bytes);
  /// Whether there was no room for a segment or for some of its pulses.
  bool is_full() const { return full_; }

 private:
  std::optional<EncodedMotion> encode(const MotionSegment& segment) const;
  bool has_room_for(size_t bytes) const;
  void count(std::span<const int64_t> pulses, size_t bytes);

  MotionEncoderOptions options_;
  MotionFileLimits limits_;
  int64_t last_pulse_ = -1;
  size_t segments_ = 0;
  uint64_t bytes_ = kMotionFileHeaderBytes;
  bool full_ = false;
};

/// A segment of a file. The surface of a pulse that two segments share is that of the later one.
struct MotionSegmentInfo {
  std::vector<int64_t> pulses;
  size_t key = 0;
  size_t vertices = 0, triangles = 0;
  double step_m = 0;
  bool coloured = false, colours_change = false, has_confidences = false;
};

/// The template of a segment: the surface at its key pulse.
struct MotionTemplate {
  std::vector<VertexTriangle> triangles;
  std::vector<VertexPosition> positions;  ///< metres, world
  std::vector<VertexColour> colours;      ///< constant, or the mean over the pulses; or empty
};

/// A decoded pulse; every decoder returns the same bits.
struct MotionPulse {
  int64_t pulse = 0;
  std::vector<VertexPosition> positions;  ///< metres, world
  std::vector<VertexColour> colours;      ///< of this pulse, else of the template; or empty
  std::vector<uint8_t> confidences;       ///< 0: only predicted; or empty
};

/// Reads a motion file in memory, in any order of pulses. Accepts any bytes: the time is at most
/// proportional to their number plus the limits, and memory stays below 2 GB. One caller at a time.
class MotionReader {
 public:
  /// `bytes` are borrowed. Empty unless they are a whole motion file with valid headers.
  static std::optional<MotionReader> open(std::span<const uint8_t> bytes);
  MotionReader(MotionReader&&) noexcept;
  MotionReader& operator=(MotionReader&&) noexcept;
  ~MotionReader();

  const std::vector<MotionSegmentInfo>& segments() const;

  /// The template of a segment; null when it is damaged. Valid until a call with another segment.
  const MotionTemplate* surface(size_t segment);
  /// Decodes a pulse by its index in the segment; null when it, or one that it needs, is damaged.
  /// Valid until the next call. Keeps what the next pulse needs, so that playing forward decodes
  /// each pulse once.
  const MotionPulse* decode(size_t segment, size_t index);

 private:
  class Impl;
  explicit MotionReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::codec
