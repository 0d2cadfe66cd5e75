// How a surface passes through a cube of eight voxel centres: the 256 cases of discrete marching
// cubes.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace v3d {

// Corner c of a cube lies at (c & 1, c >> 1 & 1, c >> 2). A case is a set of occupied corners, bit
// c for corner c. The edge of a cube along axis a (0 x, 1 y, 2 z) is number 4 * a + m, where m's
// low bit is its place along the lower one of the two other axes, m's high bit along the higher
// one.

/// Where an edge starts (its lower end); it runs one step along `axis`.
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

inline constexpr int kMostCubeTriangles = 10;

/// Triangles between the midpoints of edges, counter-clockwise seen from the empty side.
struct CubeCase {
  int count = 0;
  std::array<std::array<uint8_t, 3>, kMostCubeTriangles> triangles{};
};

/// The surface of a case. Two rules make the whole surface closed and 2-manifold:
///   - Where a face of the cube has two occupied and two empty corners crosswise, the occupied ones
///     are joined. The rule looks at the face alone, so both cubes at a face draw the same lines.
///   - Where the loop of lines round the faces has more than three corners, it is cut into
///   triangles
///     along lines that run inside the cube, never in a face, where the neighbour could draw the
///     same line a second time. Every case has such a cut; of several, the one with the shortest
///     lines.
const std::array<CubeCase, 256>& cube_cases();

}  // namespace v3d
