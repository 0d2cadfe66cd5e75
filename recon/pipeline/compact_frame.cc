#include "recon/pipeline/compact_frame.h"

#include <algorithm>

namespace v3d::recon {

std::vector<codec::VertexColour> vertex_colours(std::span<const Rgb8> colours) {
  std::vector<codec::VertexColour> coded(colours.size());
  std::transform(colours.begin(), colours.end(), coded.begin(), [](Rgb8 c) {
    return codec::VertexColour{c.r, c.g, c.b};
  });
  return coded;
}

std::vector<Rgb8> rgb_colours(std::span<const codec::VertexColour> colours) {
  std::vector<Rgb8> shown(colours.size());
  std::transform(colours.begin(), colours.end(), shown.begin(), [](const codec::VertexColour& c) {
    return Rgb8{c[0], c[1], c[2]};
  });
  return shown;
}

std::vector<codec::VertexPosition> vertex_positions(std::span<const Eigen::Vector3f> vertices) {
  std::vector<codec::VertexPosition> positions(vertices.size());
  std::transform(vertices.begin(), vertices.end(), positions.begin(), [](const Eigen::Vector3f& v) {
    return codec::VertexPosition{v.x(), v.y(), v.z()};
  });
  return positions;
}

std::vector<std::array<uint32_t, 3>> triangles_of_performer(const Mesh& mesh,
                                                            std::span<const uint8_t> performers,
                                                            int performer) {
  std::vector<std::array<uint32_t, 3>> kept;
  if (performers.empty()) return kept;
  std::ranges::copy_if(mesh.triangles, std::back_inserter(kept), [&](const auto& triangle) {
    return std::ranges::all_of(triangle, [&](uint32_t v) { return performers[v] == performer; });
  });
  return kept;
}

Mesh mesh_of(const codec::DecodedFrame& decoded) {
  Mesh mesh;
  for (const auto& [x, y, z] : decoded.positions) mesh.vertices.emplace_back(x, y, z);
  mesh.triangles = decoded.triangles;
  mesh.colours = rgb_colours(decoded.colours);
  return mesh;
}

CompactFrame CompactDecoder::frame() const {
  const codec::DecodedFrame& decoded = decoder_.frame();
  const codec::FrameMetadata& metadata = decoded.metadata;
  return {.pulse = metadata.pulse,
          .exposure = from_ns<Realtime>(metadata.exposure_ns),
          .cameras = metadata.cameras,
          .late_cameras = metadata.late_cameras,
          .missing = metadata.missing,
          .quality = metadata.quality,
          .live_passes = metadata.live_passes,
          .performers = decoded.labels,
          .views = decoded.cameras,
          .lattice = {{metadata.origin[0], metadata.origin[1], metadata.origin[2]}, metadata.step},
          .mesh = mesh_of(decoded)};
}

std::optional<CompactFrame> decode_compact(std::span<const uint8_t> bytes) {
  CompactDecoder decoder;
  if (decoder.decode(bytes) != codec::DecodeStatus::kOk) return std::nullopt;
  return decoder.frame();
}

}  // namespace v3d::recon
