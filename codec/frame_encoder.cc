#include <algorithm>
#include <cmath>
#include <utility>

#include "codec/check.h"
#include "codec/coded_surface.h"
#include "codec/frame_codec.h"
#include "codec/vertex_values.h"

namespace v3d::codec {
namespace {

/// Rounds positions to lattice numbers. Empty when a number is too large or a position is not
/// finite.
std::optional<std::vector<VertexValues>> numbers_of(std::span<const VertexPosition> positions,
                                                    const FrameMetadata& metadata) {
  constexpr double kMaxNumber = 1 << 29;
  std::vector<VertexValues> numbers(positions.size());
  for (size_t v = 0; v < positions.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const double at =
          std::floor((double{positions[v][axis]} - metadata.origin[axis]) / metadata.step + 0.5);
      if (!(at >= -kMaxNumber && at <= kMaxNumber)) return std::nullopt;
      numbers[v][axis] = static_cast<int32_t>(at);
    }
  }
  return numbers;
}

/// Whether the vertices lie where the volume has them.
bool are_undisplaced(std::span<const VertexValues> numbers, const FrameState& state) {
  for (size_t v = 0; v < numbers.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      if (numbers[v][axis] != state.surface.positions[v][axis] * state.header.subdivision)
        return false;
    }
  }
  return true;
}

}  // namespace

class FrameEncoder::Impl {
 public:
  explicit Impl(const EncoderOptions& options) : options_(options) {
    V3D_CODEC_CHECK(options.key_every >= 1 && options.displacement_step_m > 0);
    for (const int step : options.colour_steps)
      V3D_CODEC_CHECK(step >= 1 && step <= kMaxColourStep);
  }

  std::optional<std::vector<uint8_t>> encode(const FrameContent& content) {
    FrameState& now = states_[1 - last_];
    Sections sections;
    if (!begin(content, now) || !encode_shape(content, now, sections[kShape]) ||
        !encode_positions(content, now, sections[kDisplacements]) ||
        !encode_colours(content, now, sections[kColours]) ||
        !encode_labels(content, now, sections[kLabels])) {
      restart();
      return std::nullopt;
    }
    sections[kNames] = encode_names(content.metadata);
    std::vector<uint8_t> bytes = write_frame(now.header, sections);
    last_ = 1 - last_;
    has_frame_ = true;
    return bytes;
  }
  void restart() { has_frame_ = false; }

  const FrameState& last() const { return states_[last_]; }

 private:
  bool begin(const FrameContent& content, FrameState& now) {
    now.header = {};
    now.header.metadata = content.metadata;
    now.header.cameras = static_cast<uint16_t>(content.metadata.cameras.size());
    now.header.key_pulse = content.metadata.pulse;
    if (!content.metadata.late_cameras.empty()) now.header.flags |= FrameHeader::kLate;
    now.numbers.clear();
    now.surface.colours.clear();
    now.labels.clear();
    return metadata_error(content.metadata) == nullptr;
  }

  static bool encode_shape(const FrameContent& content, FrameState& now,
                           std::vector<uint8_t>& bytes) {
    return content.volume != nullptr ? encode_volume(content, now, bytes)
                                     : encode_mesh(content, now, bytes);
  }

  static bool encode_volume(const FrameContent& content, FrameState& now,
                            std::vector<uint8_t>& bytes) {
    CodedSurface& surface = now.surface;
    if (!surface.volume.assign(*content.volume)) return false;
    surface.measure();
    FrameHeader& h = now.header;
    h.vertices = surface.surface.vertex_count();
    h.triangles = surface.surface.triangle_count();
    if (h.vertices > FrameLimits::kVertices || h.triangles > FrameLimits::kTriangles) return false;
    for (int axis = 0; axis < 3; ++axis) {
      h.first_brick[axis] = static_cast<uint16_t>(surface.volume.first[axis]);
      h.bricks[axis] = static_cast<uint16_t>(surface.volume.counts()[axis]);
    }
    surface.make_positions();
    if (content.triangles.empty()) {
      surface.make_triangles();
    } else {
      if (content.triangles.size() != h.triangles) return false;
      surface.triangles.assign(content.triangles.begin(), content.triangles.end());
    }
    if (!content.positions.empty() || !content.colours.empty() || !content.labels.empty()) {
      surface.make_known();
    }
    bytes = encode_occupancy(surface.volume);
    return true;
  }

  static bool encode_mesh(const FrameContent& content, FrameState& now,
                          std::vector<uint8_t>& bytes) {
    FrameHeader& h = now.header;
    if (content.positions.size() > FrameLimits::kVertices ||
        content.triangles.size() > FrameLimits::kTriangles) {
      return false;
    }
    h.flags |= FrameHeader::kExplicit;
    h.vertices = static_cast<uint32_t>(content.positions.size());
    h.triangles = static_cast<uint32_t>(content.triangles.size());
    auto coded = encode_triangles(content.triangles, h.vertices);
    if (!coded) return false;
    bytes = *std::move(coded);
    now.surface.triangles.assign(content.triangles.begin(), content.triangles.end());
    now.surface.known.make(now.surface.triangles, h.vertices);
    return true;
  }

  bool encode_positions(const FrameContent& content, FrameState& now,
                        std::vector<uint8_t>& bytes) const {
    FrameHeader& h = now.header;
    const bool is_explicit = h.is(FrameHeader::kExplicit);
    if (!is_explicit && content.positions.empty()) return true;
    if (content.positions.size() != h.vertices) return false;
    if (!is_explicit) subdivide(h);
    auto numbers = numbers_of(content.positions, h.metadata);
    if (!numbers) return false;
    std::vector<VertexValues> from(h.vertices);
    if (!is_explicit) {
      if (are_undisplaced(*numbers, now)) {
        h.subdivision = 1;
        h.metadata.step = content.metadata.step;
        return true;
      }
      h.flags |= FrameHeader::kDisplaced;
      from = smoothed_positions(now.surface, h.subdivision);
    }
    return encode_numbers(*std::move(numbers), from, now, bytes);
  }

  void subdivide(FrameHeader& h) const {
    const double steps = std::ceil(h.metadata.step / options_.displacement_step_m - 1e-6);
    h.subdivision = static_cast<uint16_t>(
        std::clamp(steps, 1.0, static_cast<double>(FrameLimits::kSubdivision)));
    h.metadata.step /= h.subdivision;
  }

  static bool encode_numbers(std::vector<VertexValues> numbers, std::span<const VertexValues> from,
                             FrameState& now, std::vector<uint8_t>& bytes) {
    const ValueRange range = position_range(now.header);
    std::vector<VertexValues> values(numbers.size());
    for (size_t v = 0; v < numbers.size(); ++v) {
      for (int axis = 0; axis < 3; ++axis) {
        values[v][axis] = numbers[v][axis] - from[v][axis];
        if (values[v][axis] < range.min || values[v][axis] > range.max) return false;
      }
    }
    bytes = encode_values(values, now.surface.known, range);
    now.numbers = std::move(numbers);
    return true;
  }

  bool encode_colours(const FrameContent& content, FrameState& now, std::vector<uint8_t>& bytes) {
    FrameHeader& h = now.header;
    if (content.colours.empty()) return true;
    if (content.colours.size() != h.vertices) return false;
    h.flags |= FrameHeader::kColours;
    h.colour_steps = options_.colour_steps;
    std::vector<LumaChroma> wanted(h.vertices);
    std::transform(content.colours.begin(), content.colours.end(), wanted.begin(), luma_chroma_of);
    const PreviousFrameColours previous(last().surface, now.surface);
    const bool follows = may_follow(h);
    if (follows) {
      h.flags |= FrameHeader::kInter;
      h.key_pulse = last().header.key_pulse;
      h.reference = last().header.checksum;
    }
    CodedColours coded = v3d::codec::encode_colours(wanted, now.surface.known, h.colour_steps,
                                                    follows ? &previous : nullptr);
    bytes = std::move(coded.bytes);
    now.surface.colours = std::move(coded.decoded);
    return true;
  }

  static bool encode_labels(const FrameContent& content, FrameState& now,
                            std::vector<uint8_t>& bytes) {
    if (content.labels.empty()) return true;
    if (content.labels.size() != now.header.vertices) return false;
    now.header.flags |= FrameHeader::kLabelled;
    now.labels.assign(content.labels.begin(), content.labels.end());
    bytes = v3d::codec::encode_labels(content.labels, now.surface.known);
    return true;
  }

  bool may_follow(const FrameHeader& h) const {
    const FrameHeader& before = last().header;
    const int64_t now = h.metadata.pulse, then = before.metadata.pulse;
    return has_frame_ && !h.is(FrameHeader::kExplicit) && !before.is(FrameHeader::kExplicit) &&
           before.is(FrameHeader::kColours) && then < now &&
           then / options_.key_every == now / options_.key_every;
  }

  const EncoderOptions options_;
  std::array<FrameState, 2> states_;
  int last_ = 0;            ///< index of the last frame in states_
  bool has_frame_ = false;  ///< states_[last_] is a frame that the next one may reference
};

FrameEncoder::FrameEncoder(const EncoderOptions& options)
    : impl_(std::make_unique<Impl>(options)) {}
FrameEncoder::~FrameEncoder() = default;

std::optional<std::vector<uint8_t>> FrameEncoder::encode(const FrameContent& content) {
  return impl_->encode(content);
}
void FrameEncoder::restart() { impl_->restart(); }

DecodedFrame FrameEncoder::decoded() const {
  DecodedFrame frame;
  make_mesh(impl_->last(), frame);
  frame.triangles = impl_->last().surface.triangles;
  return frame;
}

std::vector<VertexColour> FrameEncoder::decoded_colours() const {
  return colours_of(impl_->last().surface.colours);
}

FrameBytes FrameEncoder::bytes() const {
  const auto& bytes = impl_->last().header.section_bytes;
  return {FrameHeader::kBytes + bytes[kNames], bytes[kShape], bytes[kDisplacements],
          bytes[kColours]};
}

}  // namespace v3d::codec
