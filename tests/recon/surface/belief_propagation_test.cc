#include "recon/surface/belief_propagation.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <random>

#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

constexpr int kLabels = BeliefPropagation::kLabels;
constexpr uint8_t kSlope = 31;

struct Graph {
  std::vector<BeliefPropagation::Costs> costs;
  std::vector<BeliefPropagation::Edge> edges;

  std::vector<uint8_t> solve(const BeliefPropagationOptions& options = {}) const {
    BeliefPropagation field;
    const auto labels = field.solve(costs, edges, options);
    return {labels.begin(), labels.end()};
  }
};

/// One label costs 0, all others `others`.
BeliefPropagation::Costs wish(int label, int16_t others) {
  BeliefPropagation::Costs costs;
  costs.of.fill(others);
  costs.of[label] = 0;
  return costs;
}

/// A chain of nodes.
Graph chain(size_t nodes) {
  Graph graph;
  graph.costs.resize(nodes);
  for (uint32_t n = 1; n < nodes; ++n) graph.edges.emplace_back(n - 1, n);
  return graph;
}

Graph random_graph() {
  std::mt19937 random(3);
  Graph graph = chain(200);
  for (BeliefPropagation::Costs& costs : graph.costs) {
    for (int16_t& cost : costs.of)
      cost = static_cast<int16_t>(random() % BeliefPropagation::kMaxCost);
  }
  for (uint32_t n = 0; n + 20 < graph.costs.size(); n += 3) graph.edges.emplace_back(n + 20, n);
  return graph;
}

/// The total cost of the labels.
int64_t price_of(const Graph& graph, const std::vector<uint8_t>& labels) {
  int64_t sum = 0;
  for (size_t n = 0; n < labels.size(); ++n) sum += graph.costs[n].of[labels[n]];
  for (const auto& [a, b] : graph.edges) {
    sum += kSlope * std::min(std::abs(labels[a] - labels[b]), BeliefPropagation::kMaxStep);
  }
  return sum;
}

/// The minimum cost of a chain, by dynamic programming.
int64_t min_price(const Graph& chain) {
  std::vector<int64_t> least(kLabels, 0);
  for (size_t n = 0; n < chain.costs.size(); ++n) {
    std::vector<int64_t> next(kLabels);
    for (int k = 0; k < kLabels; ++k) {
      int64_t best = n == 0 ? 0 : INT64_MAX;
      for (int from = 0; n > 0 && from < kLabels; ++from) {
        best = std::min(
            best, least[from] + kSlope * std::min(std::abs(from - k), BeliefPropagation::kMaxStep));
      }
      next[k] = best + chain.costs[n].of[k];
    }
    least = next;
  }
  return *std::min_element(least.begin(), least.end());
}

TEST(BeliefPropagation, finds_the_optimum_of_a_chain) {
  std::mt19937 random(5);
  for (int i = 0; i < 20; ++i) {
    Graph graph = chain(12);
    for (BeliefPropagation::Costs& costs : graph.costs) {
      for (int16_t& cost : costs.of) cost = static_cast<int16_t>(random() % 250);
    }
    // Damped messages move by half of the difference in each iteration: many iterations are needed.
    const int64_t price = price_of(graph, graph.solve({.slope = kSlope, .iterations = 60}));
    EXPECT_LE(price, min_price(graph) + 6);
  }
}

TEST(BeliefPropagation, gives_nodes_without_data_the_labels_of_their_neighbours) {
  Graph graph = chain(7);
  graph.costs[0] = wish(9, 125);
  graph.costs[6] = wish(9, 125);
  for (const uint8_t label : graph.solve()) EXPECT_EQ(label, 9);
}

TEST(BeliefPropagation, corrects_a_wrong_node_by_its_neighbours) {
  Graph graph = chain(9);
  for (auto& costs : graph.costs) costs = wish(4, 150);
  graph.costs[4] = wish(29, 150);
  EXPECT_EQ(graph.solve()[4], 4);
}

TEST(BeliefPropagation, keeps_a_step_between_two_certain_sides) {
  Graph graph = chain(10);
  for (size_t n = 0; n < 10; ++n) graph.costs[n] = wish(n < 5 ? 2 : 30, 375);
  const std::vector<uint8_t> labels = graph.solve();
  for (size_t n = 0; n < 10; ++n) EXPECT_EQ(labels[n], n < 5 ? 2 : 30);
}

TEST(BeliefPropagation, selects_each_nodes_own_minimum_without_edges) {
  Graph graph;
  for (int label : {0, 31, 7}) graph.costs.push_back(wish(label, 1));
  EXPECT_EQ(graph.solve(), (std::vector<uint8_t>{0, 31, 7}));
  EXPECT_TRUE(Graph{}.solve().empty());
}

TEST(BeliefPropagation, is_the_same_on_every_instruction_set_and_any_number_of_threads) {
  const Graph graph = random_graph();
  const std::vector<uint8_t> expected = graph.solve();
  EXPECT_LT(price_of(graph, expected), 0.8 * price_of(graph, Graph{graph.costs, {}}.solve()));
  on_every_instruction_set([&] { EXPECT_EQ(graph.solve(), expected); });
  EXPECT_EQ(tbb::task_arena(1).execute([&] { return graph.solve(); }), expected);
}

TEST(BeliefPropagation, is_independent_of_the_previous_graph) {
  const Graph first = random_graph();
  Graph other = chain(3);
  other.costs[1] = wish(5, 100);
  BeliefPropagation field;
  field.solve(first.costs, first.edges, {});
  field.solve(other.costs, other.edges, {});
  const auto again = field.solve(first.costs, first.edges, {});
  EXPECT_EQ(std::vector<uint8_t>(again.begin(), again.end()), first.solve());
}

}  // namespace
}  // namespace v3d::recon
