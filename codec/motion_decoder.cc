#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "codec/byte_stream.h"
#include "codec/connectivity_code.h"
#include "codec/motion_codec.h"
#include "codec/motion_header.h"
#include "codec/motion_pulse.h"

namespace v3d::codec {
namespace {

std::vector<VertexPosition> metres_of(std::span<const LatticePosition> positions,
                                      const MotionSegmentHeader& header) {
  std::vector<VertexPosition> metres(positions.size());
  for (size_t v = 0; v < positions.size(); ++v) {
    for (size_t axis = 0; axis < 3; ++axis) {
      metres[v][axis] = static_cast<float>(header.origin[axis] + positions[v][axis] * header.step);
    }
  }
  return metres;
}

std::vector<VertexColour> colours_of(std::span<const LumaChroma> colours) {
  std::vector<VertexColour> rgb;
  rgb.reserve(colours.size());
  for (const LumaChroma& colour : colours) rgb.push_back(colour_of(colour));
  return rgb;
}

/// Sections of the record of a pulse.
struct PulseRecord {
  std::span<const uint8_t> positions, colours, confidences;
};

std::optional<PulseRecord> split(std::span<const uint8_t> bytes) {
  constexpr size_t kHeader = 2 * sizeof(uint32_t);
  if (bytes.size() < kHeader) return std::nullopt;
  ByteReader in(bytes);
  const size_t colours = in.number<uint32_t>(), confidences = in.number<uint32_t>();
  const auto rest = bytes.subspan(kHeader);
  if (colours > rest.size() || confidences > rest.size() - colours) return std::nullopt;
  const size_t positions = rest.size() - colours - confidences;
  return PulseRecord{rest.first(positions), rest.subspan(positions, colours),
                     rest.last(confidences)};
}

/// Decoder of one segment, whose header is valid.
class SegmentDecoder {
 public:
  SegmentDecoder(std::span<const uint8_t> bytes, const MotionSegmentHeader& header)
      : bytes_(bytes), header_(header) {
    size_t at = header.header_bytes() + header.template_bytes();
    for (const MotionTableEntry& entry : header.table) {
      first_.push_back(at);
      at += entry.bytes;
    }
  }

  /// False when the template is damaged.
  bool decode_template() {
    auto rest = bytes_.subspan(header_.header_bytes(), header_.template_bytes());
    if (crc32(rest) != header_.template_checksum) return false;
    std::array<std::span<const uint8_t>, 3> sections;
    for (size_t n = 0; n < sections.size(); ++n) {
      sections[n] = rest.first(header_.section_bytes[n]);
      rest = rest.subspan(header_.section_bytes[n]);
    }
    auto triangles =
        decode_connectivity(sections[kMotionTriangles], header_.triangles, header_.vertices);
    if (!triangles) return false;
    hierarchy_.emplace(*triangles, header_.vertices);
    if (!decode_positions(sections[kMotionPositions], *hierarchy_, {}, template_) ||
        (header_.is(MotionSegmentHeader::kColoured) &&
         !decode_motion_colours(sections[kMotionColours], *hierarchy_, header_.colour_steps, {},
                                template_))) {
      return false;
    }
    finish_template(*hierarchy_, template_);
    surface_ = {std::move(*triangles), metres_of(template_.positions, header_),
                colours_of(template_.colours)};
    return true;
  }

  const MotionTemplate& surface() const { return surface_; }

  const MotionPulse* decode(uint32_t index) {
    forget_all_but(index);
    const PulseState* state = state_of(index);
    if (state == nullptr) return nullptr;
    pulse_.pulse = header_.table[index].pulse;
    pulse_.positions = metres_of(state->positions, header_);
    pulse_.colours = header_.is(MotionSegmentHeader::kColoursChange) ? colours_of(state->colours)
                                                                     : surface_.colours;
    pulse_.confidences.clear();
    for (const uint8_t level : state->confidences) {
      pulse_.confidences.push_back(confidence_of(level, header_.confidence_levels));
    }
    return &pulse_;
  }

 private:
  std::vector<uint32_t> references_of(uint32_t index) const {
    return motion_references(index, static_cast<uint32_t>(header_.table.size()), header_.period);
  }

  /// Deletes the states that neither `index` nor one of its references is.
  void forget_all_but(uint32_t index) {
    std::set<uint32_t> needed;
    std::vector<uint32_t> pending{index};
    while (!pending.empty()) {
      const uint32_t next = pending.back();
      pending.pop_back();
      if (!needed.insert(next).second) continue;
      for (const uint32_t reference : references_of(next)) pending.push_back(reference);
    }
    for (auto state = states_.begin(); state != states_.end();) {
      state = needed.count(state->first) > 0 ? std::next(state) : states_.erase(state);
    }
  }

  /// Decodes a pulse after its references; null when one is damaged.
  const PulseState* state_of(uint32_t index) {
    const auto known = states_.find(index);
    if (known != states_.end()) return &known->second;
    std::vector<const PulseState*> references;
    for (const uint32_t reference : references_of(index)) {
      references.push_back(state_of(reference));
      if (references.back() == nullptr) return nullptr;
    }
    const auto bytes = bytes_.subspan(first_[index], header_.table[index].bytes);
    if (crc32(bytes) != header_.table[index].checksum) return nullptr;
    const auto record = split(bytes);
    PulseState state;
    if (!record || !decode_record(*record, references, state)) return nullptr;
    return &states_.emplace(index, std::move(state)).first->second;
  }

  bool decode_record(const PulseRecord& record, std::vector<const PulseState*>& references,
                     PulseState& state) const {
    const bool change = header_.is(MotionSegmentHeader::kColoursChange);
    const size_t levels = header_.confidence_levels;
    if (change == record.colours.empty() || (levels > 0) == record.confidences.empty()) {
      return false;
    }
    if (levels > 0 &&
        !decode_confidences(record.confidences, *hierarchy_, levels, references, state)) {
      return false;
    }
    if (references.empty()) references.push_back(&template_);
    return decode_positions(record.positions, *hierarchy_, references, state) &&
           (!change || decode_motion_colours(record.colours, *hierarchy_, header_.colour_steps,
                                             references, state));
  }

  std::span<const uint8_t> bytes_;
  const MotionSegmentHeader& header_;
  std::vector<size_t> first_;  ///< [pulse]: offset of its record in the segment
  std::optional<VertexHierarchy> hierarchy_;
  PulseState template_;
  MotionTemplate surface_;
  std::map<uint32_t, PulseState> states_;  ///< decoded pulses by index
  MotionPulse pulse_;
};

MotionSegmentInfo info_of(const MotionSegmentHeader& header) {
  MotionSegmentInfo info;
  for (const MotionTableEntry& entry : header.table) info.pulses.push_back(entry.pulse);
  info.key = header.key;
  info.vertices = header.vertices;
  info.triangles = header.triangles;
  info.step_m = header.step;
  info.coloured = header.is(MotionSegmentHeader::kColoured);
  info.colours_change = header.is(MotionSegmentHeader::kColoursChange);
  info.has_confidences = header.confidence_levels > 0;
  return info;
}

}  // namespace

class MotionReader::Impl {
 public:
  /// False unless the bytes are a file with valid headers.
  bool open(std::span<const uint8_t> bytes) {
    if (!is_motion_file_header(bytes)) return false;
    bytes = bytes.subspan(kMotionFileHeaderBytes);
    int64_t last = -1;
    while (!bytes.empty()) {
      auto header = read_motion_segment_header(bytes);
      if (!header || header->table.front().pulse < last ||
          headers_.size() == MotionLimits::kSegments) {
        return false;
      }
      last = header->table.back().pulse;
      bytes_.push_back(bytes.first(header->bytes));
      bytes = bytes.subspan(header->bytes);
      infos_.push_back(info_of(*header));
      headers_.push_back(std::move(*header));
    }
    return true;
  }

  const std::vector<MotionSegmentInfo>& segments() const { return infos_; }

  /// The decoder of a segment; null when its template is damaged.
  SegmentDecoder* decoder(size_t segment) {
    if (segment >= headers_.size()) return nullptr;
    if (!decoder_ || segment != current_) {
      decoder_.reset();  // also if memory is exhausted: half a template must not stay
      auto next = std::make_unique<SegmentDecoder>(bytes_[segment], headers_[segment]);
      valid_ = next->decode_template();
      decoder_ = std::move(next);
      current_ = segment;
    }
    return valid_ ? decoder_.get() : nullptr;
  }

  const MotionPulse* decode(size_t segment, size_t index) {
    SegmentDecoder* of = decoder(segment);
    if (of == nullptr || index >= headers_[segment].table.size()) return nullptr;
    return of->decode(static_cast<uint32_t>(index));
  }

 private:
  std::vector<MotionSegmentHeader> headers_;
  std::vector<MotionSegmentInfo> infos_;
  std::vector<std::span<const uint8_t>> bytes_;  ///< of each segment
  std::unique_ptr<SegmentDecoder> decoder_;
  size_t current_ = 0;
  bool valid_ = false;
};

MotionReader::MotionReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MotionReader::MotionReader(MotionReader&&) noexcept = default;
MotionReader& MotionReader::operator=(MotionReader&&) noexcept = default;
MotionReader::~MotionReader() = default;

std::optional<MotionReader> MotionReader::open(std::span<const uint8_t> bytes) {
  auto impl = std::make_unique<Impl>();
  if (!impl->open(bytes)) return std::nullopt;
  return MotionReader(std::move(impl));
}

const std::vector<MotionSegmentInfo>& MotionReader::segments() const { return impl_->segments(); }

const MotionTemplate* MotionReader::surface(size_t segment) {
  const SegmentDecoder* decoder = impl_->decoder(segment);
  return decoder == nullptr ? nullptr : &decoder->surface();
}

const MotionPulse* MotionReader::decode(size_t segment, size_t index) {
  return impl_->decode(segment, index);
}

}  // namespace v3d::codec
