#include "codec/cube_cases.h"

#include <limits>
#include <vector>

#include "codec/check.h"

namespace v3d::codec {
namespace {

/// Corners of the six faces, counter-clockwise seen from outside the cube.
constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5},   // x = 0, x = 1
                              {0, 1, 5, 4}, {2, 6, 7, 3},   // y = 0, y = 1
                              {0, 2, 3, 1}, {4, 5, 7, 6}};  // z = 0, z = 1

constexpr int kEdges = 12;

/// The edge between two neighbouring corners.
int edge_between(int a, int b) {
  const int low = a & b;
  switch (a ^ b) {
    case 1:
      return low >> 1;
    case 2:
      return 4 + ((low & 1) | (low >> 1 & 2));
    default:
      V3D_CODEC_CHECK((a ^ b) == 4);
      return 8 + (low & 3);
  }
}

/// For each crossed edge the next one along its loop, else -1. Each face is traversed
/// counter-clockwise seen from outside. A line runs from an edge where the traversal enters the
/// occupied part to one where it leaves. The neighbouring cube traverses the face in the other
/// direction and has the reversed line.
std::array<int, kEdges> follow_lines(int occupied) {
  std::array<int, kEdges> next;
  next.fill(-1);
  for (const auto& face : kFaces) {
    const auto is_occupied = [&](int n) { return (occupied >> face[n % 4] & 1) != 0; };
    for (int n = 0; n < 4; ++n) {
      if (is_occupied(n) || !is_occupied(n + 1)) continue;  // the traversal does not enter here
      // Go back to the edge where the traversal last left: this separates the empty corners between
      // the two.
      int leave = n;
      while (!is_occupied(leave)) leave = (leave + 3) % 4;
      next[edge_between(face[n], face[(n + 1) % 4])] =
          edge_between(face[leave], face[(leave + 1) % 4]);
    }
  }
  return next;
}

bool in_one_face(int edge_a, int edge_b) {
  for (const auto& face : kFaces) {
    int found = 0;
    for (int n = 0; n < 4; ++n) {
      const int edge = edge_between(face[n], face[(n + 1) % 4]);
      found += edge == edge_a || edge == edge_b;
    }
    if (found == 2) return true;
  }
  return false;
}

/// Squared distance of the midpoints of two edges, in half edges of the cube.
int distance2(int edge_a, int edge_b) {
  const auto midpoint = [](int number) {
    const CubeEdge e = cube_edge(number);
    std::array<int, 3> m{2 * e.x, 2 * e.y, 2 * e.z};
    m[e.axis] = 1;
    return m;
  };
  const auto a = midpoint(edge_a);
  const auto b = midpoint(edge_b);
  int sum = 0;
  for (int axis = 0; axis < 3; ++axis) sum += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  return sum;
}

constexpr int kImpossible = 1000;

/// The cheapest cut of the part loop[first..last] of a polygon into triangles: its cost, and the
/// third corner of the triangle on the line first-last. Exhaustive search: a loop has at most 12
/// corners.
struct Cut {
  int cost = 0;
  int tip = -1;
};

Cut best_cut(const std::vector<int>& loop, int first, int last) {
  if (last - first < 2) return {};
  Cut best{kImpossible, -1};
  const auto line_cost = [&](int a, int b) {
    if (b - a == 1 || (a == 0 && b == static_cast<int>(loop.size()) - 1)) return 0;
    return in_one_face(loop[a], loop[b]) ? kImpossible : distance2(loop[a], loop[b]);
  };
  for (int tip = first + 1; tip < last; ++tip) {
    int cost = line_cost(first, tip) + line_cost(tip, last);
    if (cost >= best.cost) continue;
    cost += best_cut(loop, first, tip).cost + best_cut(loop, tip, last).cost;
    if (cost < best.cost) best = {cost, tip};
  }
  return best;
}

void add_triangles(CubeCase& out, const std::vector<int>& loop, int first, int last) {
  if (last - first < 2) return;
  const int tip = best_cut(loop, first, last).tip;
  V3D_CODEC_CHECK(tip > 0);
  add_triangles(out, loop, first, tip);
  out.triangles[out.count++] = {static_cast<uint8_t>(loop[first]), static_cast<uint8_t>(loop[tip]),
                                static_cast<uint8_t>(loop[last])};
  add_triangles(out, loop, tip, last);
}

CubeCase derive(int occupied) {
  CubeCase result;
  std::array<int, kEdges> next = follow_lines(occupied);
  for (int start = 0; start < kEdges; ++start) {
    std::vector<int> loop;
    for (int edge = start; next[edge] >= 0;) {
      loop.push_back(edge);
      const int following = next[edge];
      next[edge] = -1;
      edge = following;
    }
    if (!loop.empty()) add_triangles(result, loop, 0, static_cast<int>(loop.size()) - 1);
  }
  return result;
}

}  // namespace

const std::array<CubeCase, 256>& cube_cases() {
  static const std::array<CubeCase, 256> cases = [] {
    std::array<CubeCase, 256> all;
    for (int occupied = 0; occupied < 256; ++occupied) all[occupied] = derive(occupied);
    return all;
  }();
  return cases;
}

}  // namespace v3d::codec
