#include "recon/surface/displacement_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "recon/shapes.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

/// Possible observations of the vertices of a mesh.
struct Observations {
  Neighbours neighbours;
  std::vector<DepthProfile> profiles;
  std::vector<uint8_t> known;
  std::vector<OutlinePull> pulls;

  explicit Observations(const Mesh& mesh)
      : neighbours(mesh),
        profiles(mesh.vertices.size(), DepthProfile{}),
        known(profiles.size(), 0),
        pulls(profiles.size()) {}

  std::vector<float> solve(const DisplacementFieldOptions& options) const {
    DisplacementField field;
    const auto found = field.solve(NeighbourRows(neighbours), profiles, known, pulls, options);
    return {found.begin(), found.end()};
  }
};

/// Profiles that end high and low, some unknown, and some outlines.
Observations random_observations() {
  std::mt19937 random(3);
  const auto unit = [&] { return static_cast<float>(random() % 10'000) / 10'000; };
  Observations observations(shapes::sphere({0, 0, 0}, 1, 13));
  for (size_t v = 0; v < observations.profiles.size(); ++v) {
    observations.known[v] = random() % 4 != 0;
    for (float& p : observations.profiles[v]) p = 2 * unit() - 1;
    if (random() % 5 == 0) observations.pulls[v] = {3 * unit(), unit() - 0.5F};
  }
  return observations;
}

/// Reference implementation, one vertex at a time.
class PlainField {
 public:
  PlainField(const Observations& observations, const DisplacementFieldOptions& options)
      : observations_(observations), o_(options), field_(observations.known.size(), 0.0F) {
    for (int sweep = 0; sweep < o_.sweeps; ++sweep) {
      const float strict = static_cast<float>(sweep) / static_cast<float>(o_.sweeps - 1);
      std::vector<Pick> targets;
      for (size_t v = 0; v < field_.size(); ++v) targets.push_back(pick(v, o_.coupling * strict));
      for (int i = 0; i < 4; ++i) smooth(targets);
    }
    for (float& f : field_) f *= o_.step_m;
  }
  const std::vector<float>& field() const { return field_; }

 private:
  struct Pick {
    float weight, steps;
  };

  Pick pick(size_t v, float coupling) const {
    Pick pick{observations_.pulls[v].weight, observations_.pulls[v].sum_m / o_.step_m};
    if (!observations_.known[v]) return pick;
    const DepthProfile& profile = observations_.profiles[v];
    std::array<float, kDepthSteps> value;
    for (int k = 0; k < kDepthSteps; ++k) {
      const float off = o_.first + static_cast<float>(k) - field_[v];
      value[k] = profile[k] - coupling * off * off;
    }
    const auto at = std::max_element(value.begin(), value.end()) - value.begin();
    const bool end = at == 0 || at + 1 == kDepthSteps;
    float fraction = 0;
    if (!end) {
      const float bend = value[at - 1] - 2 * value[at] + value[at + 1];
      if (bend < 0) {
        fraction = std::clamp(0.5F * (value[at - 1] - value[at + 1]) / bend, -0.5F, 0.5F);
      }
    }
    float sum = 0;
    for (const float p : profile) sum += p;
    const float height = profile[at] - sum / kDepthSteps;
    const float weight = o_.photometric * (std::max(0.0F, height) * std::max(0.0F, profile[at]) *
                                           (end ? 0.2F : 1.0F));
    pick.weight += weight;
    pick.steps += weight * (o_.first + static_cast<float>(at) + fraction);
    return pick;
  }

  void smooth(const std::vector<Pick>& targets) {
    std::vector<float> next(field_.size());
    for (size_t v = 0; v < field_.size(); ++v) {
      const auto around = observations_.neighbours.of(v);
      float sum = 0;
      for (const uint32_t n : around) sum += field_[n];
      const float mean = sum / static_cast<float>(std::max<size_t>(1, around.size()));
      const float weight = targets[v].weight + o_.smoothness;
      next[v] = weight > 0 ? (targets[v].steps + o_.smoothness * mean) / weight : 0.0F;
    }
    field_.swap(next);
  }

  const Observations& observations_;
  const DisplacementFieldOptions o_;
  std::vector<float> field_;
};

TEST(DisplacementField, equals_a_scalar_loop_bit_for_bit_on_every_instruction_set) {
  const Observations observations = random_observations();
  ASSERT_NE(observations.known.size() % NeighbourRows::kWidth, 0);
  for (const float smoothness : {0.3F, 0.0F}) {
    const DisplacementFieldOptions options{
        .step_m = 0.002F, .smoothness = smoothness, .coupling = 0.02F};
    const PlainField plain(observations, options);
    on_every_instruction_set([&] { EXPECT_EQ(observations.solve(options), plain.field()); });
  }
}

TEST(DisplacementField, converges_to_the_common_peak_of_parabolas) {
  Observations observations(shapes::sphere({0, 0, 0}, 1, 10));
  for (size_t v = 0; v < observations.known.size(); ++v) {
    observations.known[v] = 1;
    for (int k = 0; k < kDepthSteps; ++k) {
      const float off = static_cast<float>(k) - 5.3F;
      observations.profiles[v][k] = 1 - 0.01F * off * off;
    }
  }
  for (const float way : observations.solve({.first = -8, .step_m = 0.002F})) {
    EXPECT_NEAR(way, (5.3F - 8) * 0.002F, 2e-5F);
  }
}

TEST(DisplacementField, moves_vertices_without_data_with_their_neighbours) {
  Observations observations(shapes::sphere({0, 0, 0}, 1, 10));
  for (size_t v = 0; v < observations.known.size(); ++v) {
    if (v % 2 == 0) observations.pulls[v] = {1, 0.006F};
  }
  for (const float way : observations.solve({.step_m = 0.002F})) EXPECT_NEAR(way, 0.006F, 1e-4F);
}

TEST(DisplacementField, is_empty_for_a_mesh_without_vertices) {
  EXPECT_TRUE(Observations(Mesh{}).solve({.step_m = 0.002F}).empty());
}

TEST(NeighbourRows, list_the_neighbours_in_order_and_pad_the_rest) {
  const Mesh mesh = shapes::sphere({0, 0, 0}, 1, 5);
  const Neighbours neighbours(mesh);
  const NeighbourRows rows(neighbours);
  ASSERT_GE(rows.vertices(), mesh.vertices.size());
  for (size_t v = 0; v < rows.vertices(); ++v) {
    const size_t group = v / NeighbourRows::kWidth, lane = v % NeighbourRows::kWidth;
    const bool exists = v < mesh.vertices.size();
    const auto expected = exists ? neighbours.of(v) : std::span<const uint32_t>();
    EXPECT_EQ(rows.counts(group).of[lane], expected.size());
    size_t k = 0;
    for (const NeighbourRows::Row& row : rows.rows(group)) {
      EXPECT_EQ(row.vertex[lane], k < expected.size() ? expected[k] : rows.vertices());
      ++k;
    }
    EXPECT_GE(k, expected.size());
  }
}

}  // namespace
}  // namespace v3d::recon
