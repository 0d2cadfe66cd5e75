#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "codec/byte_stream.h"
#include "codec/connectivity_code.h"
#include "codec/motion_codec.h"
#include "codec/motion_header.h"
#include "codec/motion_pulse.h"

namespace v3d::codec {
namespace {

template <class Rows>
bool rows_have_size(const Rows& rows, size_t size) {
  return std::all_of(rows.begin(), rows.end(), [&](const auto& row) { return row.size() == size; });
}

bool is_finite(const VertexPosition& p) {
  return std::all_of(p.begin(), p.end(), [](float metres) { return std::isfinite(metres); });
}

bool is_valid(const MotionSegment& s) {
  const size_t pulses = s.pulses.size();
  if (pulses == 0 || pulses > MotionLimits::kPulses || s.key >= pulses || s.pulses[0] < 0 ||
      s.positions.size() != pulses) {
    return false;
  }
  const size_t vertices = s.positions[0].size();
  const bool increasing = std::adjacent_find(s.pulses.begin(), s.pulses.end(),
                                             std::greater_equal<>()) == s.pulses.end();
  const bool colours = s.colours.size() <= 1 || s.colours.size() == pulses;
  const bool confidences = s.confidences.empty() || s.confidences.size() == pulses;
  const bool sizes = rows_have_size(s.positions, vertices) && rows_have_size(s.colours, vertices) &&
                     rows_have_size(s.confidences, vertices);
  const auto in_range = [&](const VertexTriangle& t) {
    return *std::max_element(t.begin(), t.end()) < vertices;
  };
  return increasing && colours && confidences && sizes && vertices <= MotionLimits::kVertices &&
         s.triangles.size() <= MotionLimits::kTriangles &&
         std::all_of(s.triangles.begin(), s.triangles.end(), in_range);
}

bool is_valid(const MotionEncoderOptions& o) {
  const auto valid_step = [](uint8_t step) { return step >= 1 && step <= kMaxColourStep; };
  return o.step_m >= MotionLimits::kMinStep && o.step_m <= MotionLimits::kMaxStep &&
         o.key_every >= 1 && o.key_every <= static_cast<int>(MotionLimits::kPeriod) &&
         o.confidence_levels >= 2 && o.confidence_levels <= kMaxConfidenceLevels &&
         std::all_of(o.colour_steps.begin(), o.colour_steps.end(), valid_step);
}

/// The middle of all positions; empty when one is not finite, or beyond the limits.
std::optional<std::array<double, 3>> middle_of(
    const std::vector<std::vector<VertexPosition>>& positions) {
  VertexPosition low{}, high{};
  bool first = true;
  for (const auto& row : positions) {
    for (const VertexPosition& p : row) {
      if (!is_finite(p)) return std::nullopt;
      for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = first ? p[axis] : std::min(low[axis], p[axis]);
        high[axis] = first ? p[axis] : std::max(high[axis], p[axis]);
      }
      first = false;
    }
  }
  std::array<double, 3> middle{};
  for (size_t axis = 0; axis < 3; ++axis) {
    middle[axis] = (double{low[axis]} + double{high[axis]}) / 2;
    if (std::abs(middle[axis]) > MotionLimits::kMaxOrigin) return std::nullopt;
  }
  return middle;
}

/// Encodes one segment; its order of vertices is that of the decoder.
class SegmentEncoder {
 public:
  SegmentEncoder(const MotionSegment& segment, const MotionEncoderOptions& options)
      : segment_(segment),
        options_(options),
        vertices_(static_cast<uint32_t>(segment.positions[0].size())),
        connectivity_(encode_connectivity(segment.triangles, vertices_)),
        hierarchy_(connectivity_.triangles, vertices_) {}

  std::optional<EncodedMotion> run() {
    const auto origin = middle_of(segment_.positions);
    if (!origin) return std::nullopt;
    header_.origin = *origin;
    fill_header();
    if (!encode_template() || !encode_pulses()) return std::nullopt;
    return assembled();
  }

 private:
  void fill_header() {
    header_.key = static_cast<uint32_t>(segment_.key);
    header_.period = static_cast<uint32_t>(options_.key_every);
    header_.vertices = vertices_;
    header_.triangles = static_cast<uint32_t>(segment_.triangles.size());
    header_.step = options_.step_m;
    if (!segment_.colours.empty()) {
      header_.flags = MotionSegmentHeader::kColoured;
      header_.colour_steps = options_.colour_steps;
      if (segment_.colours.size() > 1) header_.flags |= MotionSegmentHeader::kColoursChange;
    }
    if (!segment_.confidences.empty()) {
      header_.confidence_levels = static_cast<uint8_t>(options_.confidence_levels);
    }
  }

  /// False when a position is off the lattice.
  bool set_positions(size_t pulse, PulseState& state) const {
    state.positions.resize(vertices_);
    for (uint32_t v = 0; v < vertices_; ++v) {
      const VertexPosition& from = segment_.positions[pulse][connectivity_.order[v]];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double steps = std::round((double{from[axis]} - header_.origin[axis]) / header_.step);
        if (!(std::abs(steps) <= kMaxLattice)) return false;
        state.positions[v][axis] = static_cast<int32_t>(steps);
      }
    }
    return true;
  }

  std::vector<LumaChroma> colours_of(size_t pulse) const {
    std::vector<LumaChroma> colours;
    for (const uint32_t v : connectivity_.order) {
      colours.push_back(luma_chroma_of(segment_.colours[pulse][v]));
    }
    return colours;
  }
  /// Means over the pulses.
  std::vector<LumaChroma> mean_colours() const {
    const size_t count = segment_.colours.size();
    std::vector<LumaChroma> colours;
    for (const uint32_t v : connectivity_.order) {
      std::array<size_t, 3> sum{};
      for (const auto& row : segment_.colours) {
        for (size_t c = 0; c < 3; ++c) sum[c] += row[v][c];
      }
      VertexColour mean;
      for (size_t c = 0; c < 3; ++c) mean[c] = static_cast<uint8_t>((sum[c] + count / 2) / count);
      colours.push_back(luma_chroma_of(mean));
    }
    return colours;
  }

  bool encode_template() {
    if (!set_positions(segment_.key, template_)) return false;
    sections_[kMotionTriangles] = connectivity_.bytes;
    sections_[kMotionPositions] = encode_positions(hierarchy_, {}, template_);
    if (header_.is(MotionSegmentHeader::kColoured)) {
      sections_[kMotionColours] =
          encode_motion_colours(mean_colours(), hierarchy_, header_.colour_steps, {}, template_);
    }
    finish_template(hierarchy_, template_);
    return true;
  }

  /// Encodes a pulse after its references.
  bool encode_pulse(uint32_t index) {
    if (states_.count(index) > 0) return true;
    std::vector<const PulseState*> references;
    for (const uint32_t r :
         motion_references(index, static_cast<uint32_t>(records_.size()), header_.period)) {
      if (!encode_pulse(r)) return false;
      references.push_back(&states_[r]);
    }
    const std::vector<const PulseState*> in_time = references;
    if (references.empty()) references.push_back(&template_);
    PulseState& state = states_[index];
    if (!set_positions(index, state)) return false;
    const auto positions = encode_positions(hierarchy_, references, state);
    std::vector<uint8_t> colours, confidences;
    if (header_.is(MotionSegmentHeader::kColoursChange)) {
      colours = encode_motion_colours(colours_of(index), hierarchy_, header_.colour_steps,
                                      references, state);
    }
    if (header_.confidence_levels > 0) {
      for (const uint32_t v : connectivity_.order) {
        state.confidences.push_back(
            confidence_level(segment_.confidences[index][v], header_.confidence_levels));
      }
      confidences = encode_confidences(hierarchy_, header_.confidence_levels, in_time, state);
    }
    parts_.positions += positions.size();
    parts_.colours += colours.size();
    parts_.confidences += confidences.size();
    ByteWriter record;
    record.number(static_cast<uint32_t>(colours.size()));
    record.number(static_cast<uint32_t>(confidences.size()));
    record.bytes(positions);
    record.bytes(colours);
    record.bytes(confidences);
    records_[index] = record.take();
    return true;
  }

  /// States are kept for one period, and for its ends.
  bool encode_pulses() {
    const size_t pulses = segment_.pulses.size();
    records_.resize(pulses);
    for (uint32_t index = 0; index < pulses; ++index) {
      if (!encode_pulse(index)) return false;
      if (index % header_.period == 0) states_.erase(states_.begin(), states_.find(index));
    }
    return true;
  }

  EncodedMotion assembled() {
    header_.bytes = 0;
    for (size_t n = 0; n < sections_.size(); ++n) {
      header_.section_bytes[n] = static_cast<uint32_t>(sections_[n].size());
      header_.template_checksum = crc32(sections_[n], header_.template_checksum);
    }
    for (size_t n = 0; n < records_.size(); ++n) {
      header_.table.push_back(
          {segment_.pulses[n], static_cast<uint32_t>(records_[n].size()), crc32(records_[n])});
      header_.bytes += records_[n].size();
    }
    header_.bytes += header_.header_bytes() + header_.template_bytes();
    ByteWriter out;
    out.bytes(write_motion_segment_header(header_));
    for (const auto& section : sections_) out.bytes(section);
    for (const auto& record : records_) out.bytes(record);
    EncodedMotion encoded{out.take(), std::move(connectivity_.order), parts_};
    encoded.parts.triangles = sections_[kMotionTriangles].size();
    encoded.parts.template_positions = sections_[kMotionPositions].size();
    encoded.parts.template_colours = sections_[kMotionColours].size();
    encoded.parts.header = header_.header_bytes() + 2 * sizeof(uint32_t) * records_.size();
    return encoded;
  }

  const MotionSegment& segment_;
  const MotionEncoderOptions& options_;
  uint32_t vertices_;
  CodedConnectivity connectivity_;
  VertexHierarchy hierarchy_;
  MotionSegmentHeader header_;
  std::array<std::vector<uint8_t>, 3> sections_;
  PulseState template_;
  std::map<uint32_t, PulseState> states_;      ///< by index of the pulse
  std::vector<std::vector<uint8_t>> records_;  ///< [pulse]
  MotionBytes parts_;
};

}  // namespace

std::optional<EncodedMotion> encode_motion(const MotionSegment& segment,
                                           const MotionEncoderOptions& options) {
  if (!is_valid(segment) || !is_valid(options)) return std::nullopt;
  return SegmentEncoder(segment, options).run();
}

std::vector<uint8_t> MotionWriter::header() { return motion_file_header(); }

std::optional<EncodedMotion> MotionWriter::encode(const MotionSegment& segment) const {
  if (segment.pulses.empty() || segment.pulses.front() < last_pulse_) return std::nullopt;
  return encode_motion(segment, options_);
}

bool MotionWriter::has_room_for(size_t bytes) const {
  return segments_ < limits_.segments && bytes_ + bytes <= limits_.bytes;
}

void MotionWriter::count(std::span<const int64_t> pulses, size_t bytes) {
  last_pulse_ = pulses.back();
  ++segments_;
  bytes_ += bytes;
}

std::optional<EncodedMotion> MotionWriter::add(const MotionSegment& segment) {
  auto encoded = encode(segment);
  if (!encoded || !add_encoded(segment.pulses, encoded->bytes.size())) return std::nullopt;
  return encoded;
}

bool MotionWriter::add_encoded(std::span<const int64_t> pulses, size_t bytes) {
  if (pulses.empty() || pulses.front() < last_pulse_) return false;
  if (!has_room_for(bytes)) {
    full_ = true;
    return false;
  }
  count(pulses, bytes);
  return true;
}

namespace {

/// How many first pulses of a segment probably fit into `room` bytes: fewer than all.
size_t pulses_for(const EncodedMotion& encoded, size_t pulses, uint64_t room) {
  constexpr double kSafety = 0.98;
  const MotionBytes& parts = encoded.parts;
  const auto constant = static_cast<double>(MotionSegmentHeader::kBytes + parts.triangles +
                                            parts.template_positions + parts.template_colours);
  const double for_pulses = static_cast<double>(room) - constant;
  if (for_pulses <= 0) return 0;
  const double each =
      (static_cast<double>(encoded.bytes.size()) - constant) / static_cast<double>(pulses);
  return std::min(pulses - 1, static_cast<size_t>(std::max(1.0, kSafety * for_pulses / each)));
}

void keep_first_pulses(MotionSegment& segment, size_t pulses) {
  segment.pulses.resize(pulses);
  segment.positions.resize(pulses);
  if (segment.colours.size() > 1) segment.colours.resize(pulses);
  if (!segment.confidences.empty()) segment.confidences.resize(pulses);
  segment.key = std::min(segment.key, pulses - 1);
}

}  // namespace

std::optional<EncodedMotion> MotionWriter::add_first_pulses(MotionSegment& segment) {
  auto encoded = encode(segment);
  while (encoded && !has_room_for(encoded->bytes.size())) {
    full_ = true;
    if (segments_ >= limits_.segments || bytes_ >= limits_.bytes) return std::nullopt;
    const size_t pulses = pulses_for(*encoded, segment.pulses.size(), limits_.bytes - bytes_);
    if (pulses == 0) return std::nullopt;
    keep_first_pulses(segment, pulses);
    encoded = encode(segment);
  }
  if (encoded) count(segment.pulses, encoded->bytes.size());
  return encoded;
}

}  // namespace v3d::codec
