#include "codec/frame_reviser.h"

#include <optional>
#include <utility>

#include "codec/camera_colours.h"
#include "codec/check.h"
#include "codec/vertex_values.h"

namespace v3d::codec {

DecodeStatus FrameReviser::decode(std::span<const uint8_t> bytes) {
  const DecodeStatus status = decoder_.decode(bytes);
  if (status == DecodeStatus::kOk) bytes_.assign(bytes.begin(), bytes.end());
  return status;
}

FrameReviser::Revision FrameReviser::revision() const {
  auto header = read_header(bytes_);
  V3D_CODEC_CHECK(header.has_value());
  Revision revision{*std::move(header), {}};
  for (const Section each : {kNames, kShape, kDisplacements, kColours, kLabels, kCameras}) {
    const bool present =
        each < kLabels ||
        revision.header.is(each == kLabels ? FrameHeader::kLabelled : FrameHeader::kCameras);
    if (!present) continue;
    const auto bytes = section(bytes_, revision.header, each);
    revision.sections[each].assign(bytes.begin(), bytes.end());
  }
  return revision;
}

std::vector<uint8_t> FrameReviser::finish(Revision& revision) {
  if (revision.header.is(FrameHeader::kInter)) revision.header.reference = checksum_;
  std::vector<uint8_t> bytes = write_frame(revision.header, revision.sections);
  checksum_ = revision.header.checksum;
  return bytes;
}

std::vector<uint8_t> FrameReviser::labelled(std::span<const uint8_t> labels) {
  V3D_CODEC_CHECK(labels.empty() || labels.size() == frame().positions.size());
  Revision revised = revision();
  revised.header.flags &= static_cast<uint16_t>(~FrameHeader::kLabelled);
  revised.sections[kLabels].clear();
  if (!labels.empty()) {
    KnownVertices known;
    known.make(frame().triangles, revised.header.vertices);
    revised.sections[kLabels] = encode_labels(labels, known);
    revised.header.flags |= FrameHeader::kLabelled;
  }
  return finish(revised);
}

std::vector<uint8_t> FrameReviser::with_cameras(std::span<const CameraView> views,
                                                size_t max_bytes) {
  V3D_CODEC_CHECK(views.empty() || views.size() == frame().metadata.cameras.size());
  Revision revised = revision();
  revised.header.flags &= static_cast<uint16_t>(~FrameHeader::kCameras);
  revised.sections[kCameras].clear();
  cost_ = {};
  const bool fits = uint64_t{revised.header.vertices} * views.size() <= FrameLimits::kCameraColours;
  if (!views.empty() && revised.header.is(FrameHeader::kColours) && fits) {
    encode_views(views, max_bytes, revised);
  } else {
    residuals_.clear();
  }
  cameras_ = frame().metadata.cameras;
  return finish(revised);
}

void FrameReviser::encode_views(std::span<const CameraView> views, size_t max_bytes,
                                Revision& revision) {
  const FrameState& now = decoder_.state();
  std::vector<uint32_t> vertices;
  std::optional<PreviousCameras> previous;
  if (revision.header.is(FrameHeader::kInter) && !residuals_.empty() &&
      cameras_ == frame().metadata.cameras) {
    vertices = previous_vertices(decoder_.state_before().surface, now.surface);
    previous = {residuals_, vertices};
  }
  CodedCameras coded = encode_cameras(views, CameraSurface(now, frame().triangles),
                                      previous ? &*previous : nullptr, max_bytes);
  cost_ = {coded.bytes.size(), coded.step};
  revision.sections[kCameras] = std::move(coded.bytes);
  revision.header.flags |= FrameHeader::kCameras;
  residuals_ = std::move(coded.residuals);
}

}  // namespace v3d::codec
