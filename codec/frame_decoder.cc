#include <utility>

#include "codec/camera_colours.h"
#include "codec/coded_surface.h"
#include "codec/frame_codec.h"
#include "codec/vertex_values.h"

namespace v3d::codec {

class FrameDecoder::Impl {
 public:
  DecodeStatus decode(std::span<const uint8_t> bytes) {
    auto header = read_header(bytes);
    if (!header) return DecodeStatus::kMalformed;
    if (header->is(FrameHeader::kInter) && !follows(*header)) return DecodeStatus::kNeedsReference;
    if (!decode_names(section(bytes, *header, kNames), *header)) return DecodeStatus::kMalformed;
    FrameState& now = states_[1 - last_];
    now.header = *std::move(header);
    if (!decode_shape(bytes, now) || !decode_displacements(bytes, now) ||
        !decode_colours(bytes, now) || !decode_labels(bytes, now) || !decode_cameras(bytes, now)) {
      return DecodeStatus::kMalformed;
    }
    make_mesh(now, frame_);
    frame_.cameras.clear();
    for (const CameraResiduals& camera : now.cameras) {
      frame_.cameras.push_back(view_of(camera, now.surface.colours));
    }
    frame_.triangles.swap(now.surface.triangles);
    last_ = 1 - last_;
    has_frame_ = true;
    return DecodeStatus::kOk;
  }
  const DecodedFrame& frame() const { return frame_; }
  const FrameState& state() const { return states_[last_]; }
  const FrameState& state_before() const { return states_[1 - last_]; }
  void enable_cameras(bool enabled) { cameras_enabled_ = enabled; }

 private:
  bool follows(const FrameHeader& header) const {
    const FrameHeader& before = states_[last_].header;
    return has_frame_ && before.checksum == header.reference &&
           before.key_pulse == header.key_pulse && before.is(FrameHeader::kColours) &&
           !before.is(FrameHeader::kExplicit);
  }

  static bool decode_shape(std::span<const uint8_t> bytes, FrameState& now) {
    const FrameHeader& h = now.header;
    const auto shape = section(bytes, h, kShape);
    if (h.is(FrameHeader::kExplicit)) {
      auto triangles = decode_triangles(shape, h.triangles, h.vertices);
      if (!triangles) return false;
      now.surface.triangles = *std::move(triangles);
      now.surface.known.make(now.surface.triangles, h.vertices);
      return true;
    }
    now.surface.volume.clear({h.first_brick[0], h.first_brick[1], h.first_brick[2]},
                             {h.bricks[0], h.bricks[1], h.bricks[2]});
    if (!decode_occupancy(shape, now.surface.volume)) return false;
    now.surface.measure();
    if (now.surface.surface.vertex_count() != h.vertices ||
        now.surface.surface.triangle_count() != h.triangles) {
      return false;
    }
    now.surface.make_positions();
    now.surface.make_triangles();
    constexpr uint16_t kPredicted =
        FrameHeader::kDisplaced | FrameHeader::kColours | FrameHeader::kLabelled;
    if (h.is(kPredicted)) now.surface.make_known();
    return true;
  }

  static bool decode_displacements(std::span<const uint8_t> bytes, FrameState& now) {
    now.numbers.clear();
    const auto coded = section(bytes, now.header, kDisplacements);
    if (coded.empty()) return true;
    auto values = decode_values(coded, now.surface.known, position_range(now.header));
    if (!values) return false;
    now.numbers = *std::move(values);
    if (now.header.is(FrameHeader::kExplicit)) return true;
    const auto from = smoothed_positions(now.surface, now.header.subdivision);
    for (size_t v = 0; v < from.size(); ++v) {
      for (int axis = 0; axis < 3; ++axis) now.numbers[v][axis] += from[v][axis];
    }
    return true;
  }

  bool decode_colours(std::span<const uint8_t> bytes, FrameState& now) const {
    now.surface.colours.clear();
    const auto coded = section(bytes, now.header, kColours);
    if (coded.empty()) return true;
    const PreviousFrameColours previous(states_[last_].surface, now.surface);
    auto values =
        v3d::codec::decode_colours(coded, now.surface.known, now.header.colour_steps,
                                   now.header.is(FrameHeader::kInter) ? &previous : nullptr);
    if (!values) return false;
    now.surface.colours = *std::move(values);
    return true;
  }

  static bool decode_labels(std::span<const uint8_t> bytes, FrameState& now) {
    now.labels.clear();
    if (!now.header.is(FrameHeader::kLabelled)) return true;
    auto labels = v3d::codec::decode_labels(section(bytes, now.header, kLabels), now.surface.known);
    if (!labels) return false;
    now.labels = *std::move(labels);
    return true;
  }

  /// Leaves the frame without these colours when the frame before was decoded without them.
  bool decode_cameras(std::span<const uint8_t> bytes, FrameState& now) const {
    now.cameras.clear();
    if (!cameras_enabled_ || !now.header.is(FrameHeader::kCameras)) return true;
    const FrameState& before = states_[last_];
    const bool may_follow = now.header.is(FrameHeader::kInter) &&
                            before.header.metadata.cameras == now.header.metadata.cameras;
    std::vector<uint32_t> vertices;
    std::optional<PreviousCameras> previous;
    if (may_follow && !before.cameras.empty()) {
      vertices = previous_vertices(before.surface, now.surface);
      previous = {before.cameras, vertices};
    }
    const CameraStatus status = v3d::codec::decode_cameras(
        section(bytes, now.header, kCameras), now.header.cameras,
        CameraSurface(now, now.surface.triangles), previous ? &*previous : nullptr, now.cameras);
    if (status != CameraStatus::kOk) now.cameras.clear();
    return status == CameraStatus::kOk || (status == CameraStatus::kNeedsPrevious && may_follow);
  }

  std::array<FrameState, 2> states_;
  int last_ = 0;            ///< index of the last frame in states_
  bool has_frame_ = false;  ///< states_[last_] holds a frame
  bool cameras_enabled_ = false;
  DecodedFrame frame_;
};

FrameDecoder::FrameDecoder() : impl_(std::make_unique<Impl>()) {}
FrameDecoder::~FrameDecoder() = default;
DecodeStatus FrameDecoder::decode(std::span<const uint8_t> bytes) { return impl_->decode(bytes); }
const DecodedFrame& FrameDecoder::frame() const { return impl_->frame(); }
void FrameDecoder::enable_cameras(bool enabled) { impl_->enable_cameras(enabled); }
const FrameState& FrameDecoder::state() const { return impl_->state(); }
const FrameState& FrameDecoder::state_before() const { return impl_->state_before(); }

}  // namespace v3d::codec
