// Encoder and decoder of one pulse of a tracked surface: positions, colours, confidences.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/colour_code.h"
#include "codec/entropy_coder.h"
#include "codec/vertex_hierarchy.h"

namespace v3d::codec {

/// An integer of any size below 2^22: its binary digits are counted by adaptive bits. The two
/// digits after the leading one are adaptive, too; the rest and the sign are even bits.
class IntegerModel {
 public:
  static constexpr int kMaxDigits = 22;

  template <class Coder>
  int code(Coder& coder, int value) {
    const int wanted = value < 0 ? -value : value;
    size_t digits = 0;
    while (digits < kMaxDigits && coder.bit(more_[digits], wanted >> digits != 0)) ++digits;
    if (digits == 0) return 0;
    int magnitude = 1;
    for (size_t after = 1; after < digits; ++after) {
      const bool digit = (wanted >> (digits - 1 - after) & 1) != 0;
      const bool coded = after <= 2 ? coder.bit(next_[digits][next_model(after, magnitude)], digit)
                                    : coder.even_bit(digit);
      magnitude = 2 * magnitude + int{coded};
    }
    return coder.even_bit(value < 0) ? -magnitude : magnitude;
  }

 private:
  /// The second digit after the leading one has a model for each value of the first.
  static size_t next_model(size_t after, int magnitude) {
    return after == 1 ? 0 : 1 + static_cast<size_t>(magnitude & 1);
  }

  std::array<BitModel, kMaxDigits> more_;
  std::array<std::array<BitModel, 3>, kMaxDigits + 1> next_;  ///< [digits]
};

/// Models of the residuals of positions, by class of the expected magnitude.
class PositionModels {
 public:
  /// `expected`: eight times the expected magnitude.
  IntegerModel& of(uint32_t expected);

 private:
  static constexpr size_t kClasses = 20;
  std::array<IntegerModel, kClasses> models_;
};

/// Models of the residuals of colours.
class ColourModels {
 public:
  /// `around`: eight times the mean magnitude around the vertex. `luma`: residual of the luma of
  /// the vertex, 0 for the luma itself.
  IntegerModel& of(size_t channel, uint32_t around, int luma);

 private:
  static constexpr size_t kClasses = 8, kLumaClasses = 3;
  std::array<std::array<std::array<IntegerModel, kLumaClasses>, kClasses>, 3> models_;
};

inline constexpr size_t kMaxConfidenceLevels = 8;

/// Models of the levels of confidences: a binary tree for each pair of expected levels.
class ConfidenceModels {
 public:
  using Tree = std::array<BitModel, kMaxConfidenceLevels>;
  /// Requires levels below kMaxConfidenceLevels: of the references, and of the neighbours.
  Tree& of(size_t in_time, size_t in_space) { return trees_[in_time][in_space]; }

 private:
  std::array<std::array<Tree, kMaxConfidenceLevels>, kMaxConfidenceLevels> trees_;
};

/// One pulse as decoded, and what predicts other pulses from it. Vectors are by vertex.
struct PulseState {
  std::vector<LatticePosition> positions;
  /// Position minus the weighted mean of the coarse neighbours, 1/16 step.
  std::vector<LatticePosition> laplacians;
  std::vector<uint8_t> residuals;  ///< sum of the three residuals of a position, at most 255
  std::vector<LumaChroma> colours;
  std::vector<std::array<uint8_t, 3>> colour_residuals;  ///< magnitudes, at most 255
  std::vector<uint8_t> confidences;                      ///< levels
  // Models after the last vertex. A pulse begins with those of its first reference.
  PositionModels position_models;
  ColourModels colour_models;
  ConfidenceModels confidence_models;
};

/// Pulses that were decoded before and predict a pulse; the nearest first.
inline constexpr size_t kMaxReferences = 4;
using References = std::span<const PulseState* const>;

// Positions.

/// Greatest coordinate on the lattice, steps; the least is -kMaxLattice.
inline constexpr int kMaxLattice = 1 << 20;

/// Encodes state.positions and sets the other members that concern positions. Requires coordinates
/// on the lattice.
std::vector<uint8_t> encode_positions(const VertexHierarchy& hierarchy, References references,
                                      PulseState& state);
/// Sets the members that concern positions. False unless the bytes are what an encoder writes.
bool decode_positions(std::span<const uint8_t> bytes, const VertexHierarchy& hierarchy,
                      References references, PulseState& state);
// Colours.

/// Encodes `colours` and sets the members that concern colours.
std::vector<uint8_t> encode_motion_colours(std::span<const LumaChroma> colours,
                                           const VertexHierarchy& hierarchy,
                                           const ColourSteps& steps, References references,
                                           PulseState& state);
/// Sets the members that concern colours. False unless the bytes are what an encoder writes.
bool decode_motion_colours(std::span<const uint8_t> bytes, const VertexHierarchy& hierarchy,
                           const ColourSteps& steps, References references, PulseState& state);

// Confidences.

/// Encodes state.confidences. Requires levels below `levels`, which is 2 to kMaxConfidenceLevels.
std::vector<uint8_t> encode_confidences(const VertexHierarchy& hierarchy, size_t levels,
                                        References references, PulseState& state);
/// Sets the members that concern confidences. False unless the bytes are what an encoder writes.
bool decode_confidences(std::span<const uint8_t> bytes, const VertexHierarchy& hierarchy,
                        size_t levels, References references, PulseState& state);

/// Level of a confidence from 0 to 255; only 0 has level 0.
uint8_t confidence_level(uint8_t confidence, size_t levels);
uint8_t confidence_of(uint8_t level, size_t levels);

// Template.

/// Prepares a coded template to predict pulses: fits the weights of the hierarchy to it, sets its
/// Laplacians by them, and sets its residuals to 0.
void finish_template(VertexHierarchy& hierarchy, PulseState& state);

}  // namespace v3d::codec
