#include "recon/skeleton/graph_branches.h"

#include <algorithm>
#include <numbers>
#include <numeric>

#include "base/core/statistics.h"

namespace v3d::recon {
namespace {

constexpr auto kNone = ReebNode::kNoParent;
constexpr double kMinArea = 0.0002;  ///< of a node
constexpr double kWidening = 1.6;    ///< of the perimeter at the end of a slender part

/// Nodes by the branch that they belong to: sweeps from high values of the integral to low ones.
class Sweep {
 public:
  explicit Sweep(const ReebLevel& level) : level_(level), around_(level.nodes.size()) {
    for (const auto& [a, b] : level.edges) {
      around_[a].push_back(b);
      around_[b].push_back(a);
    }
    branch_of_.assign(level.nodes.size(), kNone);
  }

  void run() {
    std::vector<uint32_t> order(level_.nodes.size());
    std::iota(order.begin(), order.end(), 0U);
    const auto high = [&](uint32_t n) { return level_.nodes[n].high_m; };
    std::ranges::sort(order, [&](uint32_t a, uint32_t b) {
      return high(a) != high(b) ? high(a) > high(b) : a < b;
    });
    for (const uint32_t node : order) {
      if (level_.nodes[node].area >= kMinArea) visit(node);
    }
  }

  struct Branch {
    std::vector<uint32_t> nodes;  ///< all, from high to low
    uint32_t elder = kNone;       ///< the branch that it meets
    double low_m = 0;             ///< where
  };
  const std::vector<Branch>& branches() const { return branches_; }

 private:
  uint32_t eldest(uint32_t branch) const {
    while (branches_[branch].elder != kNone) branch = branches_[branch].elder;
    return branch;
  }

  void visit(uint32_t node) {
    uint32_t joined = kNone;
    for (const uint32_t other : around_[node]) {
      if (branch_of_[other] == kNone) continue;
      const uint32_t branch = eldest(branch_of_[other]);
      if (joined == kNone || branch == joined) {
        joined = branch;
        continue;
      }
      const auto [elder, younger] = std::minmax(joined, branch);  // the end of the first is higher
      branches_[younger].elder = elder;
      branches_[younger].low_m = level_.nodes[node].high_m;
      joined = elder;
    }
    if (joined == kNone) {
      joined = static_cast<uint32_t>(branches_.size());
      branches_.emplace_back();
    }
    branches_[joined].nodes.push_back(node);
    if (branches_[joined].elder == kNone) branches_[joined].low_m = level_.nodes[node].low_m;
    branch_of_[node] = joined;
  }

  const ReebLevel& level_;
  std::vector<std::vector<uint32_t>> around_;
  std::vector<uint32_t> branch_of_;
  std::vector<Branch> branches_;
};

/// Of three nodes from one on: the perimeter of a single node is noisy.
double narrowest(const ReebLevel& level, const GraphBranch& branch, size_t first) {
  double least = level.nodes[branch.nodes[first]].perimeter;
  for (size_t i = first + 1; i < std::min(first + 3, branch.nodes.size()); ++i) {
    least = std::min(least, level.nodes[branch.nodes[i]].perimeter);
  }
  return least;
}

void measure_slender(const ReebLevel& level, const std::vector<size_t>& divided,
                     GraphBranch& branch) {
  std::vector<double> perimeters;
  for (size_t i = 0; i < branch.nodes.size(); ++i) {
    const ReebNode& node = level.nodes[branch.nodes[i]];
    if (divided[i] > 1) break;
    if (i > 3 && narrowest(level, branch, i) > kWidening * upper_median(perimeters)) break;
    if (i > 0) {
      const ReebNode& last = level.nodes[branch.nodes[i - 1]];
      branch.slender_length_m += (node.centre - last.centre).norm();
    }
    perimeters.push_back(node.perimeter);
    ++branch.slender;
  }
  if (!perimeters.empty()) {
    branch.slender_radius_m = upper_median(perimeters) / (2 * std::numbers::pi);
  }
}

GraphBranch branch_of(const ReebLevel& level, const Sweep::Branch& swept) {
  GraphBranch branch;
  std::vector<size_t> divided;  // nodes of each interval
  std::vector<uint32_t> nodes = swept.nodes;
  std::ranges::stable_sort(nodes, std::ranges::greater(),
                           [&](uint32_t n) { return level.nodes[n].interval; });
  for (const uint32_t n : nodes) {
    const ReebNode& node = level.nodes[n];
    branch.area += node.area;
    if (branch.nodes.empty() || level.nodes[branch.nodes.back()].interval != node.interval) {
      branch.nodes.push_back(n);
      divided.push_back(1);
      continue;
    }
    ++divided.back();
    if (node.area > level.nodes[branch.nodes.back()].area) branch.nodes.back() = n;
  }
  branch.end = level.nodes[branch.nodes[0]].centre;
  branch.length_m = level.nodes[branch.nodes[0]].high_m - swept.low_m;
  measure_slender(level, divided, branch);
  return branch;
}

}  // namespace

std::vector<GraphBranch> graph_branches(const ReebGraph& graph, double min_length_m) {
  std::vector<GraphBranch> result;
  if (graph.empty()) return result;
  Sweep sweep(graph.levels.back());
  sweep.run();
  for (const Sweep::Branch& swept : sweep.branches()) {
    const GraphBranch branch = branch_of(graph.levels.back(), swept);
    if (branch.length_m >= min_length_m) result.push_back(branch);
  }
  std::ranges::stable_sort(result, std::ranges::greater(), &GraphBranch::length_m);
  return result;
}

}  // namespace v3d::recon
