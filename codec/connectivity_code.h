// Lossless codec of the triangles of a mesh by traversal: about two bits for each triangle.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d::codec {

/// Encoded triangles, and how the traversal renumbers them.
struct CodedConnectivity {
  std::vector<uint8_t> bytes;
  /// The triangles as decoded: in the order of the traversal, each turned, not mirrored.
  std::vector<std::array<uint32_t, 3>> triangles;
  /// [decoded vertex]: vertex of the input. Vertices that no triangle uses come last.
  std::vector<uint32_t> order;
};

/// Encodes any list of triangles, degenerate and non-manifold ones included. Requires indices
/// below `vertices`. docs/motion-format.md is normative.
/// Source: the gates follow Touma and Gotsman, "Triangle mesh compression", Graphics Interface
/// 1998.
CodedConnectivity encode_connectivity(std::span<const std::array<uint32_t, 3>> triangles,
                                      uint32_t vertices);

/// Decodes `triangles` triangles with indices below `vertices`. Empty when the bytes do not hold
/// exactly these.
std::optional<std::vector<std::array<uint32_t, 3>>> decode_connectivity(
    std::span<const uint8_t> bytes, uint32_t triangles, uint32_t vertices);

}  // namespace v3d::codec
