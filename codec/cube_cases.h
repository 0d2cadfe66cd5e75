// The 256 cases of discrete marching cubes: the surface inside a cube of eight voxel centres.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace v3d::codec {

// Corner c of a cube lies at (c & 1, c >> 1 & 1, c >> 2). A case is a set of occupied corners, bit
// c for corner c. The edge of a cube along axis a (0 x, 1 y, 2 z) is number 4 * a + m, where m's
// low bit is its position along the lower one of the two other axes, m's high bit along the higher
// one.

/// An edge of a cube: its lower end. It is one step long, along `axis`.
struct CubeEdge {
  int axis;
  int x, y, z;
};

constexpr CubeEdge cube_edge(int number) {
  const int low = number & 1;
  const int high = number >> 1 & 1;
  switch (number / 4) {
    case 0:
      return {0, 0, low, high};
    case 1:
      return {1, low, 0, high};
    default:
      return {2, low, high, 0};
  }
}

inline constexpr int kMaxCubeTriangles = 10;

/// Triangles between the midpoints of edges, counter-clockwise seen from the empty side.
struct CubeCase {
  int count = 0;
  std::array<std::array<uint8_t, 3>, kMaxCubeTriangles> triangles{};
};

/// The surface of every case, indexed by the set of occupied corners. Thread-safe. Two rules make
/// the whole surface closed and 2-manifold:
/// 1. A face with two occupied and two empty corners in diagonal positions joins the occupied ones.
///    The rule uses the face alone, so both cubes at a face have the same lines.
/// 2. A loop of lines with more than three corners is cut into triangles along lines inside the
///    cube. A line in a face is not allowed, because the neighbour could have the same line. Every
///    case has such a cut; of several cuts, the one with the shortest lines is used.
const std::array<CubeCase, 256>& cube_cases();

}  // namespace v3d::codec
