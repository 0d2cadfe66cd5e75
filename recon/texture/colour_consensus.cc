#include "recon/texture/colour_consensus.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>

#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

// Chosen with v3d-room-colours, seed 1.

/// Grey values in one channel that two means of one vertex may differ.
constexpr float kMaxContradiction = 30;
/// The same for a doubtful vertex and its neighbours.
constexpr int kMaxStep = 15;
/// Inner samples of more than this part of the weight of the deep ones are not outvoted.
constexpr float kMaxOutvoted = 2;
/// Edges over which neighbours decide about a doubtful vertex.
constexpr int kDoubtfulPasses = 12;

/// Red, green and blue times weight, and the weight.
using Sum = std::array<float, 4>;
using Triangles = std::vector<std::array<uint32_t, 3>>;

Rgb8 mean_of(const Sum& sum) {
  const auto byte = [&](size_t k) {
    return static_cast<uint8_t>(std::clamp(sum[k] / sum[3], 0.0F, 255.0F) + 0.5F);
  };
  return {byte(0), byte(1), byte(2)};
}

/// Whether the means differ; false for a sum without samples. Without divisions, because most
/// vertices have both sums.
bool contradict(const Sum& a, const Sum& b) {
  const float limit = kMaxContradiction * a[3] * b[3];
  const auto differ = [&](size_t k) { return std::abs(a[k] * b[3] - b[k] * a[3]) > limit; };
  return differ(0) || differ(1) || differ(2);
}

Sum total(const Sum& a, const Sum& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]};
}

/// The sum that decides the colour where a camera sees the vertex deep inside its silhouette.
Sum agreed(const Sum& deep, const Sum& inner) {
  const bool outvoted = inner[3] <= kMaxOutvoted * deep[3] && contradict(deep, inner);
  return outvoted ? deep : total(deep, inner);
}

/// The triangles with a vertex that is not trusted. Only these change.
Triangles unfinished(const Triangles& from, const std::vector<ColourTrust>& trust) {
  const auto open = [&](uint32_t v) { return trust[v] != ColourTrust::kTrusted; };
  Triangles result;
  std::copy_if(from.begin(), from.end(), std::back_inserter(result),
               [&](const auto& t) { return open(t[0]) || open(t[1]) || open(t[2]); });
  return result;
}

bool differs(Rgb8 a, Rgb8 b) {
  const auto far = [](int x, int y) { return std::abs(x - y) > kMaxStep; };
  return far(a.r, b.r) || far(a.g, b.g) || far(a.b, b.b);
}

/// Per vertex: sums of the colours of its trusted neighbours, and their number.
using NeighbourSums = std::vector<std::array<uint32_t, 4>>;

void add_neighbours(const Triangles& triangles, const VertexColours& vertices,
                    NeighbourSums& sums) {
  for (const auto& t : triangles) {
    for (size_t k = 0; k < 3; ++k) {
      if (vertices.trust[t[k]] == ColourTrust::kTrusted) continue;
      for (const uint32_t n : {t[(k + 1) % 3], t[(k + 2) % 3]}) {
        if (vertices.trust[n] != ColourTrust::kTrusted) continue;
        auto& [r, g, b, count] = sums[t[k]];
        r += vertices.colours[n].r, g += vertices.colours[n].g, b += vertices.colours[n].b, ++count;
      }
    }
  }
}

/// One pass. Sums are integers, and a pass reads only results of the previous one, so the order has
/// no influence. False when nothing changed.
bool spread_once(const Triangles& triangles, VertexColours& vertices, NeighbourSums& sums) {
  add_neighbours(triangles, vertices, sums);
  bool changed = false;
  for (const auto& t : triangles) {
    for (const uint32_t v : t) {
      const auto [r, g, b, n] = sums[v];
      ColourTrust& trust = vertices.trust[v];
      if (trust == ColourTrust::kTrusted || n == 0) continue;
      const auto mean = [n = n](uint32_t sum) { return static_cast<uint8_t>((sum + n / 2) / n); };
      const Rgb8 around{mean(r), mean(g), mean(b)};
      if (trust == ColourTrust::kUnseen || differs(vertices.colours[v], around)) {
        vertices.colours[v] = around;
      }
      trust = ColourTrust::kTrusted;
      changed = true;
    }
  }
  return changed;
}

void trust_all_seen(std::vector<ColourTrust>& trust) {
  std::replace(trust.begin(), trust.end(), ColourTrust::kDoubtful, ColourTrust::kTrusted);
}

}  // namespace

VertexColours::VertexColours(size_t vertices)
    : colours(vertices, kUnseenColour), trust(vertices, ColourTrust::kUnseen) {}

void decide_colours(const ColourSums& sums, size_t first, VertexColours& vertices) {
  const size_t count = std::min(PointArrays::kBlock, vertices.colours.size() - first);
  for (size_t i = 0; i < count; ++i) {
    const Sum& deep = sums.of(PixelDepth::kDeep)[i];
    const Sum& inner = sums.of(PixelDepth::kInner)[i];
    const Sum& rim = sums.of(PixelDepth::kRim)[i];
    const bool is_deep = deep[3] > 0;
    const Sum& near_outline = inner[3] > 0 ? inner : rim;
    if (!is_deep && near_outline[3] <= 0) continue;
    vertices.colours[first + i] = mean_of(is_deep ? agreed(deep, inner) : near_outline);
    vertices.trust[first + i] = is_deep ? ColourTrust::kTrusted : ColourTrust::kDoubtful;
  }
}

void spread_colours(const Mesh& mesh, int passes, VertexColours& vertices) {
  NeighbourSums sums(vertices.colours.size());
  Triangles triangles = unfinished(mesh.triangles, vertices.trust);
  for (int pass = 0; pass < std::min(passes, kDoubtfulPasses); ++pass) {
    if (!spread_once(triangles, vertices, sums)) break;
    triangles = unfinished(triangles, vertices.trust);
  }
  trust_all_seen(vertices.trust);
  triangles = unfinished(triangles, vertices.trust);
  for (int pass = kDoubtfulPasses; pass < passes; ++pass) {
    if (!spread_once(triangles, vertices, sums)) break;
    triangles = unfinished(triangles, vertices.trust);
  }
}

}  // namespace v3d::recon
