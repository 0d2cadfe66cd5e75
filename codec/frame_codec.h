// Compact frames: coloured meshes to bytes and back. docs/compact-frame.md is normative.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "codec/brick_surface.h"
#include "codec/colour.h"
#include "codec/frame_header.h"

namespace v3d {

using VertexPosition = std::array<float, 3>;
using VertexTriangle = std::array<uint32_t, 3>;

/// A mesh to be coded; all of it borrowed.
struct FrameContent {
  /// `step` is half a voxel of the volume; without a volume, the step of the lattice that vertices
  /// are rounded to.
  FrameFacts facts;
  /// The volume whose discrete marching cubes made the mesh. Null: any mesh, its vertices numbered
  /// in the order in which the triangles first use them.
  const BrickVolume* volume = nullptr;
  /// Of all vertices. With a volume, empty for vertices that were not moved.
  std::span<const VertexPosition> positions;
  /// With a volume, empty or those that BrickSurface makes of it: who has them saves the encoder
  /// making them.
  std::span<const VertexTriangle> triangles;
  std::span<const VertexColour> colours;  ///< of all vertices, or of none
};

struct EncoderOptions {
  /// Of every so many pulses the first that is encoded is a key frame, which can be decoded without
  /// others. So sequences that lack different pulses agree again, to the byte, from there on.
  int key_every = 25;
  /// Moved vertices come back to half of it along each axis, metres; less where half a voxel is no
  /// multiple of it.
  double displacement_step_m = 0.001;
  std::array<uint8_t, 3> colour_steps = kDefaultColourSteps;  ///< luma, Co, Cg
};

/// A mesh as every decoder has it, to the bit.
struct DecodedFrame {
  FrameFacts facts;
  int64_t key_pulse = 0;  ///< the key frame from which on frames are needed to decode this one
  std::vector<VertexPosition> positions;
  std::vector<VertexTriangle> triangles;
  std::vector<VertexColour> colours;  ///< one per vertex, or none
};

/// Bytes of a frame by what they are for.
struct FrameBytes {
  size_t head = 0, shape = 0, displacements = 0, colours = 0;
};

/// Encodes a sequence of frames. One caller at a time; equal sequences give equal bytes.
class FrameEncoder {
 public:
  explicit FrameEncoder(const EncoderOptions& options);
  ~FrameEncoder();

  /// Empty for content beyond the limits (FrameLimits, Occupancy, 65536 steps of the lattice along
  /// an axis, vertices moved by more than 32767 steps) or that is not as FrameContent says; the
  /// next frame is then a key frame. So it is after a frame without a volume, and where pulses do
  /// not rise.
  std::optional<std::vector<uint8_t>> encode(const FrameContent& content);
  /// The next frame is a key frame.
  void restart();

  /// Of the last frame encoded.
  DecodedFrame decoded() const;
  std::vector<VertexColour> decoded_colours() const;  ///< these alone, of decoded()
  FrameBytes bytes() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

enum class DecodeStatus {
  kOk,
  kMalformed,       ///< not a compact frame of this version, or damaged
  kNeedsReference,  ///< whole, but not made for the frame decoded last: go on at a key frame
};

/// Decodes a sequence of frames; whatever the bytes, time is at most in proportion to their number
/// plus to the limits, and memory below 2 GB. One caller at a time.
class FrameDecoder {
 public:
  FrameDecoder();
  ~FrameDecoder();

  /// Unless kOk, frame() stays, and so does what the next frame may be made for.
  DecodeStatus decode(std::span<const uint8_t> bytes);
  /// The last frame decoded. Valid until the next call of decode().
  const DecodedFrame& frame() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
