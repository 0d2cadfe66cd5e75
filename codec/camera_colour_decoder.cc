#include <utility>

#include "codec/byte_stream.h"
#include "codec/camera_colour_model.h"
#include "codec/camera_colours.h"
#include "codec/colour_model.h"

namespace v3d::codec {
namespace {

std::vector<uint64_t> codes_of(const FrameState& state) {
  std::vector<uint64_t> codes(state.header.vertices);
  const auto code = [](const auto& at) {
    return morton_code(static_cast<uint32_t>(at[0]), static_cast<uint32_t>(at[1]),
                       static_cast<uint32_t>(at[2]));
  };
  const bool by_number = state.header.is(FrameHeader::kExplicit);
  for (size_t v = 0; v < codes.size(); ++v) {
    codes[v] = by_number ? code(state.numbers[v]) : code(state.surface.positions[v]);
  }
  return codes;
}

using Normals = std::vector<std::array<double, 3>>;

/// Sums of the cross products of the triangles of each vertex. Exact: coordinates are integers.
template <class Positions>
Normals normals_of(const Positions& positions, std::span<const std::array<uint32_t, 3>> triangles) {
  Normals normals(positions.size());
  for (const auto& triangle : triangles) {
    const auto &a = positions[triangle[0]], &b = positions[triangle[1]],
               &c = positions[triangle[2]];
    std::array<double, 3> ab, ac;
    for (size_t n = 0; n < 3; ++n) {
      ab[n] = static_cast<double>(b[n]) - static_cast<double>(a[n]);
      ac[n] = static_cast<double>(c[n]) - static_cast<double>(a[n]);
    }
    for (size_t n = 0; n < 3; ++n) {
      const size_t p = (n + 1) % 3, q = (n + 2) % 3;
      const double cross = ab[p] * ac[q] - ab[q] * ac[p];
      for (const uint32_t v : triangle) normals[v][n] += cross;
    }
  }
  return normals;
}

Normals normals_of(const FrameState& state, std::span<const std::array<uint32_t, 3>> triangles) {
  return state.numbers.empty() ? normals_of(state.surface.positions, triangles)
                               : normals_of(state.numbers, triangles);
}

}  // namespace

CameraSurface::CameraSurface(const FrameState& state,
                             std::span<const std::array<uint32_t, 3>> triangles)
    : tree(codes_of(state)),
      normals(normals_of(state, triangles)),
      known(state.surface.known),
      colours(state.surface.colours) {}

std::vector<uint32_t> previous_vertices(const CodedSurface& before, const CodedSurface& now) {
  std::vector<uint32_t> vertices(now.positions.size());
  for (uint32_t v = 0; v < vertices.size(); ++v) {
    const int64_t then = previous_vertex(before, now, v);
    vertices[v] = then < 0 ? kNoVertex : static_cast<uint32_t>(then);
  }
  return vertices;
}

CameraStatus decode_cameras(std::span<const uint8_t> bytes, size_t cameras,
                            const CameraSurface& surface, const PreviousCameras* previous,
                            std::vector<CameraResiduals>& residuals) {
  constexpr size_t kFixed = 4, kAxisBytes = 6;
  if (bytes.size() < kFixed + kAxisBytes * cameras) return CameraStatus::kMalformed;
  ByteReader in(bytes);
  const auto flags = in.number<uint8_t>();
  ColourSteps steps;
  for (uint8_t& step : steps) step = in.number<uint8_t>();
  if (flags > 1 || std::count(steps.begin(), steps.end(), 0) > 0) return CameraStatus::kMalformed;
  if (flags == 1 && previous == nullptr) return CameraStatus::kNeedsPrevious;
  residuals.assign(cameras, {});
  for (CameraResiduals& camera : residuals) {
    for (int16_t& number : camera.axis) number = in.number<int16_t>();
  }
  RangeDecoder coder(bytes.subspan(kFixed + kAxisBytes * cameras));
  CameraCode code(coder, surface, flags == 1 ? previous : nullptr, steps);
  for (size_t c = 0; c < cameras; ++c) {
    if (!code.run(c, {}, residuals)) return CameraStatus::kMalformed;
  }
  return coder.ended() ? CameraStatus::kOk : CameraStatus::kMalformed;
}

CameraView view_of(const CameraResiduals& residuals, std::span<const LumaChroma> colours) {
  CameraView view{residuals.axis, std::vector<std::array<uint8_t, 4>>(colours.size())};
  for (size_t v = 0; v < colours.size(); ++v) {
    if (residuals.vertices[v][3] == 0) continue;
    const VertexColour colour =
        colour_of(clamped(lanes_of(colours[v]) + lanes_of(residuals.vertices[v])));
    view.vertices[v] = {colour[0], colour[1], colour[2], 255};
  }
  return view;
}

}  // namespace v3d::codec
