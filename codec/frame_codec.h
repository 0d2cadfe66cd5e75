// Encoder and decoder of compact frames, which are coloured meshes as bytes. docs/compact-frame.md
// is normative.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "codec/bricks.h"
#include "codec/colour_code.h"
#include "codec/frame_header.h"

namespace v3d::codec {

using VertexPosition = std::array<float, 3>;
using VertexTriangle = std::array<uint32_t, 3>;

/// A mesh to encode; all of it is borrowed.
struct FrameContent {
  /// `step`: half a voxel of the volume. Without a volume: the step of the lattice to which
  /// vertices are rounded.
  FrameMetadata metadata;
  /// The volume whose discrete marching cubes surface is the mesh. Null for any other mesh; its
  /// vertices must be numbered in the order in which the triangles first use them.
  const BrickVolume* volume = nullptr;
  /// Positions of all vertices, metres. With a volume, empty when no vertex was moved.
  std::span<const VertexPosition> positions;
  /// Triangles. With a volume, empty or the triangles that BrickSurface makes of it; then the
  /// encoder need not compute them.
  std::span<const VertexTriangle> triangles;
  std::span<const VertexColour> colours;  ///< one for each vertex, or empty
  std::span<const uint8_t> labels;        ///< performer of each vertex, 0: unknown; or empty
};

/// Units of CameraAxis in 1.
inline constexpr int kAxisUnits = 32767;
/// Viewing direction of a camera, world: a unit vector in units of 1 / kAxisUnits.
using CameraAxis = std::array<int16_t, 3>;

/// What one camera sees of a frame.
struct CameraView {
  CameraAxis axis{};
  /// [vertex]: red, green, blue (sRGB), and 255 for a vertex that the camera sees. All 0 for
  /// others.
  std::vector<std::array<uint8_t, 4>> vertices;
};

struct EncoderOptions {
  /// Period of key frames, pulses: the first encoded frame of each period is a key frame, which can
  /// be decoded alone. So sequences that lack different pulses are identical again from the next
  /// key frame.
  int key_every = 25;
  /// Step of displacements, metres: decoded vertices differ by at most half of it along each axis.
  /// The step is reduced when half a voxel is not a multiple of it, and is at least 1/64 of half a
  /// voxel (FrameLimits::kSubdivision).
  double displacement_step_m = 0.001;
  std::array<uint8_t, 3> colour_steps = kDefaultColourSteps;  ///< luma, Co, Cg; 1 to 64
};

/// A decoded mesh; every decoder returns the same bits.
struct DecodedFrame {
  FrameMetadata metadata;
  int64_t key_pulse = 0;  ///< pulse of the key frame where decoding of this frame must start
  std::vector<VertexPosition> positions;
  std::vector<VertexTriangle> triangles;
  std::vector<VertexColour> colours;  ///< one per vertex, or none
  std::vector<uint8_t> labels;        ///< performer of each vertex, 0: unknown; or none
  /// The view of each camera of metadata.cameras, or none; see FrameDecoder::enable_cameras().
  std::vector<CameraView> cameras;
};

/// Numbers of bytes of the parts of a frame.
struct FrameBytes {
  size_t head = 0, shape = 0, displacements = 0, colours = 0;
};

/// Encodes a sequence of frames. One caller at a time. Deterministic: equal sequences give equal
/// bytes.
class FrameEncoder {
 public:
  explicit FrameEncoder(const EncoderOptions& options);
  ~FrameEncoder();

  /// Encodes the next frame. Empty for content that violates FrameContent or exceeds a limit.
  /// metadata_error() names what is wrong in the metadata.
  /// Limits: FrameLimits, Occupancy, 65536 lattice steps along an axis, and 32767 steps of
  /// displacement.
  ///
  /// The next frame is a key frame after such content, after a frame without a volume, and when
  /// pulses do not increase.
  std::optional<std::vector<uint8_t>> encode(const FrameContent& content);
  /// Makes the next frame a key frame.
  void restart();

  /// These describe the last encoded frame.
  DecodedFrame decoded() const;
  std::vector<VertexColour> decoded_colours() const;  ///< the colours of decoded() alone
  FrameBytes bytes() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

enum class DecodeStatus {
  kOk,
  /// No compact frame of this version, or damaged.
  kMalformed,
  /// Complete, but its reference is not the last decoded frame. Continue at a key frame.
  kNeedsReference,
};

struct FrameState;

/// Decodes a sequence of frames. Accepts any bytes: the time is at most proportional to their
/// number plus the limits, and memory stays below 2 GB. One caller at a time.
class FrameDecoder {
 public:
  FrameDecoder();
  ~FrameDecoder();

  /// Decodes the next frame. Unless the result is kOk, frame() and the reference for the next frame
  /// do not change.
  DecodeStatus decode(std::span<const uint8_t> bytes);
  /// The last decoded frame. Valid until the next call of decode().
  const DecodedFrame& frame() const;
  /// Whether the next frames are decoded with the colours of cameras that they have. At first they
  /// are not, which takes less time and memory. Colours begin at the next key frame at the latest.
  void enable_cameras(bool enabled);

  /// For the codec: the last decoded frame without its triangles, and the frame before.
  const FrameState& state() const;
  const FrameState& state_before() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::codec
