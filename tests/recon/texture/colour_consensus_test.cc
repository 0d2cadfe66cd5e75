#include "recon/texture/colour_consensus.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "recon/shapes.h"
#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

constexpr Rgb8 kSkin{200, 150, 120}, kRoom{80, 130, 100};

/// A sample of a camera at the first vertex.
struct Sample {
  PixelDepth depth;
  Rgb8 colour;
  float weight = 1;
};

struct Decision {
  Rgb8 colour;
  ColourTrust trust;
};

Decision decided(const std::vector<Sample>& samples) {
  const auto sums = std::make_unique<ColourSums>();
  for (const auto& [depth, colour, weight] : samples) {
    auto& sum = sums->by_depth[static_cast<size_t>(depth) - 1][0];
    sum[0] += weight * colour.r, sum[1] += weight * colour.g, sum[2] += weight * colour.b;
    sum[3] += weight;
  }
  VertexColours vertices(1);
  decide_colours(*sums, 0, vertices);
  return {vertices.colours[0], vertices.trust[0]};
}

TEST(ColourConsensus, blends_samples_near_an_outline_that_agree_with_deep_ones) {
  const Decision found =
      decided({{PixelDepth::kDeep, {200, 150, 120}, 1}, {PixelDepth::kInner, {212, 150, 132}, 3}});
  EXPECT_EQ(found.colour, (Rgb8{209, 150, 129}));
  EXPECT_EQ(found.trust, ColourTrust::kTrusted);
}

TEST(ColourConsensus, leaves_out_samples_near_an_outline_that_contradict_deep_ones) {
  for (const float weight : {0.1F, 1.0F, 2.0F}) {
    const Decision found =
        decided({{PixelDepth::kDeep, kSkin, 1}, {PixelDepth::kInner, kRoom, weight}});
    EXPECT_EQ(found.colour, kSkin) << weight;
    EXPECT_EQ(found.trust, ColourTrust::kTrusted);
  }
}

TEST(ColourConsensus, notices_a_contradiction_in_any_single_channel) {
  for (const Rgb8 other : {Rgb8{169, 150, 120}, {200, 181, 120}, {200, 150, 89}}) {
    EXPECT_EQ(decided({{PixelDepth::kDeep, kSkin}, {PixelDepth::kInner, other}}).colour, kSkin);
  }
}

TEST(ColourConsensus, does_not_let_a_grazing_deep_sample_outvote_others_of_large_weight) {
  const Decision found =
      decided({{PixelDepth::kDeep, kRoom, 0.1F}, {PixelDepth::kInner, kSkin, 0.9F}});
  EXPECT_EQ(found.colour, (Rgb8{188, 148, 118}));
}

TEST(ColourConsensus, never_counts_the_rim_where_another_camera_sees_farther_inside) {
  EXPECT_EQ(decided({{PixelDepth::kDeep, kSkin}, {PixelDepth::kRim, {201, 151, 121}, 9}}).colour,
            kSkin);
  EXPECT_EQ(decided({{PixelDepth::kInner, kSkin}, {PixelDepth::kRim, {201, 151, 121}, 9}}).colour,
            kSkin);
}

TEST(ColourConsensus, doubts_colours_that_no_camera_sees_deep) {
  EXPECT_EQ(decided({{PixelDepth::kInner, kSkin}}).trust, ColourTrust::kDoubtful);
  EXPECT_EQ(decided({{PixelDepth::kRim, kSkin}}).trust, ColourTrust::kDoubtful);
  EXPECT_EQ(decided({{PixelDepth::kRim, kSkin}}).colour, kSkin);
  EXPECT_EQ(decided({}).trust, ColourTrust::kUnseen);
  EXPECT_EQ(decided({}).colour, kUnseenColour);
}

/// A strip of 40 squares. Its left end is trusted skin, the rest has `colour` and `trust`.
struct Strip {
  static constexpr int kSquares = 40;
  Mesh mesh;
  VertexColours vertices;

  Strip(Rgb8 colour, ColourTrust trust) : vertices(2 * (kSquares + 1)) {
    for (uint32_t i = 0; i <= kSquares; ++i) {
      mesh.vertices.emplace_back(0.01F * static_cast<float>(i), 0, 0);
      mesh.vertices.emplace_back(0.01F * static_cast<float>(i), 0.01F, 0);
      if (i < kSquares) mesh.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1});
      if (i < kSquares) mesh.triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
    }
    for (size_t v = 0; v < vertices.colours.size(); ++v) {
      vertices.colours[v] = v < 2 ? kSkin : colour;
      vertices.trust[v] = v < 2 ? ColourTrust::kTrusted : trust;
    }
  }
  /// How many columns of squares have skin at their right edge, from the left.
  int columns_of_skin() const {
    int columns = 0;
    while (columns < kSquares && vertices.colours[2 * columns + 2] == kSkin) ++columns;
    return columns;
  }
};

TEST(ColourConsensus, replaces_doubtful_colours_that_contradict_their_neighbours) {
  Strip strip(kRoom, ColourTrust::kDoubtful);
  spread_colours(strip.mesh, 64, strip.vertices);
  EXPECT_GE(strip.columns_of_skin(), 6);
}

TEST(ColourConsensus, keeps_doubtful_colours_like_those_of_their_neighbours) {
  const Rgb8 tanned{190, 140, 110};
  Strip strip(tanned, ColourTrust::kDoubtful);
  spread_colours(strip.mesh, 64, strip.vertices);
  for (size_t v = 2; v < strip.vertices.colours.size(); ++v) {
    EXPECT_EQ(strip.vertices.colours[v], tanned) << v;
  }
}

TEST(ColourConsensus, keeps_the_colours_of_a_thin_object_far_from_all_trusted_ones) {
  Strip strip(kRoom, ColourTrust::kDoubtful);
  spread_colours(strip.mesh, 64, strip.vertices);
  for (size_t v = 2 * 20; v < strip.vertices.colours.size(); ++v) {
    EXPECT_EQ(strip.vertices.colours[v], kRoom) << v;
  }
}

TEST(ColourConsensus, spreads_colours_to_unseen_vertices_farther_than_to_doubtful_ones) {
  Strip strip(kUnseenColour, ColourTrust::kUnseen);
  spread_colours(strip.mesh, 64, strip.vertices);
  EXPECT_EQ(strip.columns_of_skin(), Strip::kSquares);
}

TEST(ColourConsensus, fills_unseen_vertices_from_doubtful_ones_where_nothing_is_trusted) {
  Strip strip(kUnseenColour, ColourTrust::kUnseen);
  for (size_t v : {0, 1}) strip.vertices.trust[v] = ColourTrust::kDoubtful;
  spread_colours(strip.mesh, 64, strip.vertices);
  EXPECT_EQ(strip.columns_of_skin(), Strip::kSquares);
}

}  // namespace
}  // namespace v3d::recon
