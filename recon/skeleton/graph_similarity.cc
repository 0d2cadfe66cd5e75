#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <tuple>

#include "base/core/error.h"
#include "recon/skeleton/reeb_graph.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

/// Metres and parts at which the likeness of two values falls to 1/e.
constexpr double kPositionM = 0.15, kExtentM = 0.08, kPerimeterM = 0.4;

double lowest(const ReebGraph& graph) {
  double z = std::numeric_limits<double>::infinity();
  for (const ReebNode& node : graph.levels.back().nodes) z = std::min(z, node.centre.z());
  return z;
}

struct Pair {
  uint32_t a = 0, b = 0;
  double likeness = 0;
};

/// Matches two graphs level by level.
class Matcher {
 public:
  Matcher(const ReebGraph& a, const ReebGraph& b)
      : a_(a), b_(b), lowest_a_(lowest(a)), lowest_b_(lowest(b)) {}

  double similarity() {
    std::vector<Pair> parents{{ReebNode::kNoParent, ReebNode::kNoParent, 1}};
    double sum = 0;
    for (size_t level = 0; level < a_.levels.size(); ++level) {
      parents = match(level, parents);
      for (const Pair& pair : parents) sum += pair.likeness;
    }
    return std::clamp(sum / static_cast<double>(a_.levels.size()), 0.0, 1.0);
  }

 private:
  static std::vector<std::vector<uint32_t>> children(const ReebLevel& level,
                                                     const std::vector<Pair>& parents,
                                                     uint32_t Pair::*side) {
    std::vector<std::vector<uint32_t>> result(parents.size());
    if (parents[0].*side == ReebNode::kNoParent) {
      for (uint32_t n = 0; n < level.nodes.size(); ++n) result[0].push_back(n);
      return result;
    }
    std::vector<uint32_t> pair_of;
    for (uint32_t p = 0; p < parents.size(); ++p) {
      if (parents[p].*side >= pair_of.size()) {
        pair_of.resize(parents[p].*side + 1, ReebNode::kNoParent);
      }
      pair_of[parents[p].*side] = p;
    }
    for (uint32_t n = 0; n < level.nodes.size(); ++n) {
      const uint32_t parent = level.nodes[n].parent;
      if (parent < pair_of.size() && pair_of[parent] != ReebNode::kNoParent) {
        result[pair_of[parent]].push_back(n);
      }
    }
    return result;
  }

  std::vector<Pair> match(size_t level, const std::vector<Pair>& parents) const {
    std::vector<Pair> matched;
    if (parents.empty()) return matched;
    const ReebLevel& of_a = a_.levels[level];
    const ReebLevel& of_b = b_.levels[level];
    const auto of_parents_a = children(of_a, parents, &Pair::a);
    const auto of_parents_b = children(of_b, parents, &Pair::b);
    std::vector<Pair> candidates;
    for (size_t p = 0; p < parents.size(); ++p) {
      for (const uint32_t n : of_parents_a[p]) {
        for (const uint32_t m : of_parents_b[p]) {
          if (of_a.nodes[n].interval != of_b.nodes[m].interval) continue;
          candidates.push_back({n, m, likeness(of_a.nodes[n], of_b.nodes[m])});
        }
      }
    }
    // The order of equal pairs must not depend on which graph comes first.
    std::ranges::sort(candidates, [](const Pair& x, const Pair& y) {
      return std::tuple(-x.likeness, std::max(x.a, x.b), std::min(x.a, x.b)) <
             std::tuple(-y.likeness, std::max(y.a, y.b), std::min(y.a, y.b));
    });
    std::vector<uint8_t> used_a(of_a.nodes.size(), 0), used_b(of_b.nodes.size(), 0);
    for (const Pair& pair : candidates) {
      if (used_a[pair.a] != 0 || used_b[pair.b] != 0) continue;
      used_a[pair.a] = used_b[pair.b] = 1;
      matched.push_back(pair);
    }
    return matched;
  }

  double likeness(const ReebNode& m, const ReebNode& n) const {
    const double share = 0.5 * (std::min(m.area, n.area) + std::min(m.volume, n.volume));
    const Vector3d from_m = m.centre - a_.centre, from_n = n.centre - b_.centre;
    const double higher = (m.centre.z() - lowest_a_) - (n.centre.z() - lowest_b_);
    const double farther = from_m.head<2>().norm() - from_n.head<2>().norm();
    const double position = std::hypot(higher, farther) / kPositionM;
    const double extent = (m.extent - n.extent).norm() / kExtentM;
    const double perimeter =
        std::abs(std::sqrt(m.perimeter) - std::sqrt(n.perimeter)) / std::sqrt(kPerimeterM);
    return share * std::exp(-position * position) * std::exp(-extent * extent) *
           std::exp(-perimeter * perimeter);
  }

  const ReebGraph& a_;
  const ReebGraph& b_;
  double lowest_a_, lowest_b_;
};

}  // namespace

double graph_similarity(const ReebGraph& a, const ReebGraph& b) {
  if (a.empty() || b.empty()) return 0;
  V3D_CHECK(a.levels.size() == b.levels.size());
  return Matcher(a, b).similarity();
}

std::vector<SimilarPulse> most_similar(const ReebGraph& query, std::span<const ReebGraph> graphs,
                                       std::span<const int64_t> pulses, size_t count,
                                       int64_t apart) {
  V3D_CHECK(pulses.size() == graphs.size());
  std::vector<SimilarPulse> all(graphs.size());
  tbb::parallel_for(size_t{0}, graphs.size(), [&](size_t i) {
    all[i] = {pulses[i], graph_similarity(query, graphs[i])};
  });
  std::ranges::stable_sort(all, std::ranges::greater(), &SimilarPulse::similarity);
  std::vector<SimilarPulse> best;
  for (const SimilarPulse& pulse : all) {
    if (best.size() == count) break;
    const bool near = std::ranges::any_of(best, [&](const SimilarPulse& other) {
      return std::abs(pulse.pulse - other.pulse) < apart;
    });
    if (!near) best.push_back(pulse);
  }
  return best;
}

}  // namespace v3d::recon
