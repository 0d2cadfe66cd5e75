#include "codec/frame_labeller.h"

#include "codec/check.h"
#include "codec/vertex_labels.h"
#include "codec/vertex_values.h"

namespace v3d::codec {

DecodeStatus FrameLabeller::decode(std::span<const uint8_t> bytes) {
  const DecodeStatus status = decoder_.decode(bytes);
  if (status == DecodeStatus::kOk) bytes_.assign(bytes.begin(), bytes.end());
  return status;
}

std::vector<uint8_t> FrameLabeller::labelled(std::span<const uint8_t> labels) {
  V3D_CODEC_CHECK(labels.empty() || labels.size() == frame().positions.size());
  auto header = read_header(bytes_);
  V3D_CODEC_CHECK(header.has_value());
  Sections sections;
  for (const Section kept : {kNames, kShape, kDisplacements, kColours}) {
    const auto bytes = section(bytes_, *header, kept);
    sections[kept].assign(bytes.begin(), bytes.end());
  }
  header->flags &= static_cast<uint16_t>(~FrameHeader::kLabelled);
  if (!labels.empty()) {
    KnownVertices known;
    known.make(frame().triangles, header->vertices);
    sections[kLabels] = encode_labels(labels, known);
    header->flags |= FrameHeader::kLabelled;
  }
  if (header->is(FrameHeader::kInter)) header->reference = checksum_;
  std::vector<uint8_t> bytes = write_frame(*header, sections);
  checksum_ = header->checksum;
  return bytes;
}

}  // namespace v3d::codec
