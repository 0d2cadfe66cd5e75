// The compact frame: one coloured mesh as it travels and is stored. Layout: docs/compact-frame.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/mesh.h"
#include "base/time.h"

namespace v3d {

inline constexpr uint32_t kMaxCompactVertices = 1U << 22;
inline constexpr uint32_t kMaxCompactTriangles = 1U << 23;
inline constexpr int kMaxCompactCameras = 256;
inline constexpr int kMaxCompactNameBytes = 64;

/// The lattice that the vertices lie on: position = float(origin + h * step) per axis, with h a
/// whole number from 0 to 65535.
struct VertexLattice {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world, metres
  double step = 0;                                   ///< metres; half a voxel
  friend bool operator==(const VertexLattice&, const VertexLattice&) = default;
};

/// The nearest lattice point, for a place outside the lattice on its border: what decode_compact()
/// gives for it, to the bit.
Eigen::Vector3f rounded_to(const VertexLattice& lattice, const Eigen::Vector3f& position);

struct CompactFrame {
  int64_t pulse = 0;
  RealtimeInstant exposure;          ///< start: the pulse's edge; 0 when unknown
  std::vector<std::string> cameras;  ///< that took part, ascending
  int missing = 0;                   ///< cameras of the rig that did not
  VertexLattice lattice;
  Mesh mesh;
};

/// Renumbers the vertices in the order in which the triangles first use them (unused ones last, in
/// their old order): the order in which they are coded. Positions, triangles and their order stay.
Mesh in_coding_order(Mesh mesh);

/// Positions are rounded to the nearest lattice point; those of a lattice mesh come back equal to
/// the bit. decode_compact() gives in_coding_order(frame.mesh). Equal frames give equal bytes,
/// whatever the number of threads that code the sections. Throws InputError for a frame beyond the
/// limits above or a vertex outside the lattice.
std::vector<uint8_t> encode_compact(const CompactFrame& frame);

/// Hostile bytes give nothing; memory is bounded by the limits above (about 300 MB) whatever the
/// bytes say.
std::optional<CompactFrame> decode_compact(std::span<const uint8_t> bytes);

}  // namespace v3d
