#include "recon/skeleton/body_evidence.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "recon/skeleton/reeb_graph.h"

namespace v3d::recon {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr size_t kPoints = 1500;
constexpr double kMinBranchM = 0.1;
constexpr double kOtherBody = 0.5;    ///< share of the area of the largest component
constexpr double kMinHeightM = 0.5;   ///< of a body
constexpr double kMinRadiusM = 0.05;  ///< of a body, if it were a cylinder of its height
// A prop: radius at most, length at least, and how far its centres are from a line.
constexpr double kPropRadiusM = 0.042, kPropLengthM = 0.3, kPropBend = 0.05;
constexpr double kHandRadiusM = 0.06;     ///< of an arm at the hand, at most
constexpr double kMinArm = 0.15;          ///< of the height
constexpr double kMinHeadRadius = 0.025;  ///< of the height
constexpr double kHeadLength = 0.13;      ///< of the height: from the top to the chin
// Of the height: the part of a leg above the sole, and the least distance of its middle from that
// of the foot, at which it shows where the toes are.
constexpr double kShinLow = 0.06, kShinHigh = 0.1, kMinAhead = 0.01;
constexpr double kWholeFoot = 0.1;  ///< of the height: length of a foot that is flat on the ground

std::vector<Vector3d> centres_of(const ReebGraph& graph, const GraphBranch& branch, size_t count) {
  std::vector<Vector3d> centres;
  for (size_t i = 0; i < count; ++i) {
    centres.push_back(graph.levels.back().nodes[branch.nodes[i]].centre);
  }
  return centres;
}

/// The line through the slender part of a branch; empty for one that is no prop.
std::optional<PropEvidence> prop_of(const ReebGraph& graph, const GraphBranch& branch) {
  if (branch.slender_radius_m > kPropRadiusM || branch.slender_length_m < kPropLengthM) return {};
  const std::vector<Vector3d> centres = centres_of(graph, branch, branch.slender);
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& centre : centres) mean += centre / static_cast<double>(centres.size());
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (const Vector3d& centre : centres) second += (centre - mean) * (centre - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(second);
  const Vector3d axis = solver.eigenvectors().col(2);
  const auto on_axis = [&](const Vector3d& position) -> Vector3d {
    return mean + axis.dot(position - mean) * axis;
  };
  for (const Vector3d& centre : centres) {
    if ((centre - on_axis(centre)).norm() > kPropBend * branch.slender_length_m) return {};
  }
  return PropEvidence{on_axis(centres.back()), on_axis(centres.front())};
}

class Observer {
 public:
  Observer(const Mesh& mesh, const ReebGraph& graph) : mesh_(mesh), graph_(graph) {}

  BodyEvidence observe() {
    if (graph_.empty()) {
      result_.problem = "the mesh is empty";
      return result_;
    }
    find_component();
    branches_ = graph_branches(graph_, kMinBranchM);
    find_prop();
    measure_body();
    if (result_.top_m - result_.bottom_m < kMinHeightM) {
      result_.problem = "the mesh is lower than a body";
      return result_;
    }
    if (mean_radius_m() < kMinRadiusM) {
      result_.problem = "the mesh is thinner than a body";
      return result_;
    }
    name_ends();
    choose_points();
    return result_;
  }

 private:
  const ReebNode& node(uint32_t number) const { return graph_.levels.back().nodes[number]; }

  void find_component() {
    for (const ReebNode& whole : graph_.levels[0].nodes) {
      if (whole.area <= area_) continue;
      area_ = whole.area;
      component_ = whole.component;
    }
    result_.has_other_bodies =
        std::ranges::any_of(graph_.levels[0].nodes, [&](const ReebNode& whole) {
          return whole.component != component_ && whole.area >= kOtherBody * area_;
        });
  }

  void find_prop() {
    is_prop_.assign(graph_.levels.back().nodes.size(), 0);
    double longest = 0;
    for (const GraphBranch& branch : branches_) {
      const auto prop = prop_of(graph_, branch);
      if (!prop || branch.slender_length_m <= longest) continue;
      longest = branch.slender_length_m;
      result_.prop = prop;
      prop_end_ = branch.nodes[0];
      std::ranges::fill(is_prop_, 0);
      for (size_t i = 0; i < branch.slender; ++i) is_prop_[branch.nodes[i]] = 1;
    }
  }

  bool is_body(size_t vertex) const {
    const uint32_t n = graph_.node_of[vertex];
    return n != ReebNode::kNoParent && is_prop_[n] == 0 && node(n).component == component_;
  }

  void measure_body() {
    result_.bottom_m = std::numeric_limits<double>::infinity();
    result_.top_m = -result_.bottom_m;
    Vector2d low = Vector2d::Constant(result_.bottom_m), high = -low;
    size_t count = 0;
    for (size_t v = 0; v < mesh_.vertices.size(); ++v) {
      if (!is_body(v)) continue;
      const Vector3d position = mesh_.vertices[v].cast<double>();
      result_.bottom_m = std::min(result_.bottom_m, position.z());
      result_.top_m = std::max(result_.top_m, position.z());
      low = low.cwiseMin(position.head<2>());
      high = high.cwiseMax(position.head<2>());
      result_.centre += position;
      ++count;
    }
    if (count == 0) return;
    result_.centre /= static_cast<double>(count);
    result_.width_m = (high - low).maxCoeff();
  }

  /// Radius of a cylinder with the area and the height of the body without the prop, metres.
  double mean_radius_m() const {
    double area = 0;
    const std::vector<ReebNode>& nodes = graph_.levels.back().nodes;
    for (size_t n = 0; n < nodes.size(); ++n) {
      if (is_prop_[n] == 0 && nodes[n].component == component_) area += nodes[n].area;
    }
    return area * graph_.area_m2 / (2 * std::numbers::pi * height_m());
  }

  double height_m() const { return result_.top_m - result_.bottom_m; }
  double height_of(const Vector3d& position) const {
    return (position.z() - result_.bottom_m) / height_m();
  }

  void name_ends() {
    const GraphBranch* head = nullptr;
    std::vector<const GraphBranch*> others;
    for (const GraphBranch& branch : branches_) {
      if (branch.nodes[0] == prop_end_ || node(branch.nodes[0]).component != component_) continue;
      result_.branches_m += branch.length_m;
      if (height_of(branch.end) < 0.15) {
        add_foot(branch);
        continue;
      }
      others.push_back(&branch);
      if (height_of(branch.end) < 0.8 || head_radius(branch) < kMinHeadRadius * height_m())
        continue;
      if (head == nullptr || head_radius(branch) > head_radius(*head)) head = &branch;
    }
    if (head != nullptr) find_head(*head);
    for (const GraphBranch* branch : others) {
      if (branch == head || branch->length_m < kMinArm * height_m()) continue;
      if (branch->slender_radius_m > kHandRadiusM || result_.hands.size() == 2) continue;
      result_.hands.push_back(branch->end);
    }
  }

  /// Radius of the part of a branch that would be a head, metres.
  double head_radius(const GraphBranch& branch) const {
    double area = 0, length = 0;
    walk(branch, kHeadLength * height_m(), [&](const ReebNode& part, double path) {
      area += part.area * graph_.area_m2;
      length = path;
    });
    return area / (2 * std::numbers::pi * std::max(length, 0.05));
  }

  template <class Visit>
  void walk(const GraphBranch& branch, double metres, const Visit& visit) const {
    double path = 0;
    for (size_t i = 0; i < branch.nodes.size(); ++i) {
      if (i > 0) path += (node(branch.nodes[i]).centre - node(branch.nodes[i - 1]).centre).norm();
      if (path > metres) return;
      visit(node(branch.nodes[i]), path);
    }
  }

  /// The neck is where the perimeter is least; the middle of the head lies at 5 % of the height
  /// above it, the base of the neck at 4.6 % below. Hair makes the middle of the area useless.
  void find_head(const GraphBranch& branch) {
    const ReebNode* neck = nullptr;
    std::vector<const ReebNode*> last;
    double least = std::numeric_limits<double>::infinity();
    Vector3d sum = Vector3d::Zero();
    double volume = 0;
    walk(branch, 0.2 * height_m(), [&](const ReebNode& part, double path) {
      last.push_back(&part);
      if (path < 0.1 * height_m() || last.size() < 3) return;
      // The mean of three nodes: the perimeter of one is noisy.
      double perimeter = 0;
      for (size_t i = last.size() - 3; i < last.size(); ++i) perimeter += last[i]->perimeter;
      if (perimeter >= least) return;
      least = perimeter;
      neck = last[last.size() - 2];
    });
    walk(branch, 0.2 * height_m(), [&](const ReebNode& part, double) {
      if (neck != nullptr && part.interval <= neck->interval) return;
      sum += part.volume * part.centre;
      volume += part.volume;
    });
    if (neck == nullptr || volume <= 0) return;
    const Vector3d up = (sum / volume - neck->centre).normalized();
    result_.head = neck->centre + 0.05 * height_m() * up;
    result_.neck = neck->centre - 0.046 * height_m() * up;
  }

  void add_foot(const GraphBranch& branch) {
    using namespace proportions;
    if (result_.feet.size() == 2) return;
    const double reach = kFootLength * height_m();
    FootEvidence foot;
    double sole = std::numeric_limits<double>::infinity();
    const auto for_each_near = [&](const auto& visit) {
      for (size_t v = 0; v < mesh_.vertices.size(); ++v) {
        const Vector3d position = mesh_.vertices[v].cast<double>();
        if ((position - branch.end).head<2>().norm() < reach &&
            position.z() < branch.end.z() + reach && is_body(v)) {
          visit(position);
        }
      }
    };
    for_each_near([&](const Vector3d& position) { sole = std::min(sole, position.z()); });
    std::vector<Vector2d> flat;
    for_each_near([&](const Vector3d& position) {
      if (position.z() < sole + 0.03 * height_m()) flat.emplace_back(position.head<2>());
    });
    if (flat.size() < 8) return;
    measure_foot(flat, foot);
    foot.centre.z() = sole;
    std::vector<Vector2d> shin;
    for_each_near([&](const Vector3d& position) {
      const double height = (position.z() - sole) / height_m();
      if (height > kShinLow && height < kShinHigh) shin.emplace_back(position.head<2>());
    });
    point_ahead(shin, foot);
    for (const FootEvidence& other : result_.feet) {
      if ((other.centre - foot.centre).norm() < 0.06 * height_m()) return;
    }
    result_.feet.push_back(foot);
  }

  static void measure_foot(const std::vector<Vector2d>& flat, FootEvidence& foot) {
    Vector2d mean = Vector2d::Zero();
    for (const Vector2d& position : flat) mean += position / static_cast<double>(flat.size());
    Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
    for (const Vector2d& position : flat)
      second += (position - mean) * (position - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(second);
    const Vector2d axis = solver.eigenvectors().col(1);
    double low = 0, high = 0;
    for (const Vector2d& position : flat) {
      low = std::min(low, axis.dot(position - mean));
      high = std::max(high, axis.dot(position - mean));
    }
    foot.axis = Vector3d(axis.x(), axis.y(), 0);
    foot.length_m = high - low;
    foot.centre.head<2>() = mean + 0.5 * (low + high) * axis;
  }

  /// The toes are on the other side of the middle of the foot than the leg above it.
  void point_ahead(const std::vector<Vector2d>& shin, FootEvidence& foot) const {
    if (shin.size() < 8 || foot.length_m < kWholeFoot * height_m()) return;
    Vector2d leg = Vector2d::Zero();
    for (const Vector2d& position : shin) leg += position / static_cast<double>(shin.size());
    const double ahead = foot.axis.head<2>().dot(foot.centre.head<2>() - leg);
    if (std::abs(ahead) < kMinAhead * height_m()) return;
    if (ahead < 0) foot.axis = -foot.axis;
    foot.points_ahead = true;
  }

  void choose_points() {
    const size_t step = std::max<size_t>(1, mesh_.vertices.size() / kPoints);
    for (size_t v = 0; v < mesh_.vertices.size(); v += step) {
      const uint32_t n = graph_.node_of[v];
      if (n == ReebNode::kNoParent) continue;
      OutlinePoint point;
      point.position = mesh_.vertices[v].cast<double>();
      if (is_prop_[n] != 0) {
        point.capsule = static_cast<int>(kPropCapsule);
      } else if (node(n).component != component_) {
        continue;
      }
      result_.points.push_back(point);
    }
  }

  const Mesh& mesh_;
  const ReebGraph& graph_;
  BodyEvidence result_;
  std::vector<GraphBranch> branches_;
  std::vector<uint8_t> is_prop_;  ///< of each finest node
  uint32_t component_ = 0, prop_end_ = ReebNode::kNoParent;
  double area_ = 0;
};

}  // namespace

BodyEvidence body_evidence(const Mesh& mesh, const ReebGraph& graph) {
  return Observer(mesh, graph).observe();
}

}  // namespace v3d::recon
