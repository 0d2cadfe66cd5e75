// Body parts detected in meshes: ends of the Reeb graph, a prop, points of the surface; and the
// head over the pulses of a take.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/skeleton/pose_fit.h"
#include "recon/skeleton/reeb_graph.h"

namespace v3d::recon {

/// A foot: its outline on the ground.
struct FootEvidence {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< world, metres; z: of the sole
  /// Horizontal unit vector; towards the toes if `points_ahead`, else of either sign.
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  bool points_ahead = false;  ///< the leg above the foot shows where the toes are
  double length_m = 0;
};

/// A long, thin and straight branch: from where a hand holds it to its tip.
struct PropEvidence {
  Eigen::Vector3d base = Eigen::Vector3d::Zero(), tip = Eigen::Vector3d::Zero();
};

/// World frame, metres.
struct BodyEvidence {
  std::string problem;  ///< why the mesh shows no body; empty where it does
  std::vector<OutlinePoint> points;
  std::optional<Eigen::Vector3d> head, neck;  ///< middle of the head, base of the neck
  std::vector<FootEvidence> feet;             ///< at most two
  std::vector<Eigen::Vector3d> hands;         ///< ends of free arms, at most two
  std::optional<PropEvidence> prop;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of the area without the prop
  bool has_other_bodies = false;   ///< another component has half the area of the largest, or more
  double bottom_m = 0, top_m = 0;  ///< z of the body without the prop
  double width_m = 0;              ///< its larger extent along x and y
  double branches_m = 0;           ///< lengths of all branches: large for a pose
                                   ///< whose limbs are free
  /// Not much wider than high: a person with the arms apart is as wide as high.
  bool is_upright() const { return width_m <= 1.2 * (top_m - bottom_m); }
  bool is_good() const { return head && feet.size() == 2 && (prop || hands.size() == 2); }
};

/// Evidence from the largest component of a mesh, and a prop also from another one. The body stands
/// upright (world z is up): the head is the highest end that is no limb, feet are the lowest ends.
/// `graph`: of `mesh`. Deterministic; thread-safe.
BodyEvidence body_evidence(const Mesh& mesh, const ReebGraph& graph);

// The head of a body over the pulses of a take.

/// A pulse whose mesh shows a body.
struct SeenPulse {
  size_t index = 0;    ///< of the evidence
  int64_t number = 0;  ///< of the pulse: 25 a second
  const BodyEvidence* evidence = nullptr;
};

/// World frame, metres.
struct HeadPosition {
  Eigen::Vector3d head = Eigen::Vector3d::Zero(), neck = Eigen::Vector3d::Zero();
  double weight = 0;  ///< 1: an end of the graph; less: interpolated; 0: unknown
};

/// The head at all pulses of `seen`, which have ascending numbers: the longest series of ends of
/// graphs that agree with one another, and positions between them. A raised arm can look like a
/// head.
std::vector<HeadPosition> follow_head(std::span<const SeenPulse> seen);

}  // namespace v3d::recon
