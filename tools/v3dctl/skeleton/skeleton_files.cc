#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/data_url.h"
#include "recon/editing/clip.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using recon::Joint;

size_t joints_of(const TakeSkeleton& skeleton) {
  return skeleton.structure.has_prop ? size_t{recon::kJoints} : size_t{recon::kBodyJoints};
}

/// From the world, z up, to the axes of BVH and TRC files: x to the left, y up, z forward.
Vector3d y_up(const Vector3d& v) { return {v.y(), v.z(), v.x()}; }
Matrix3d y_up(const Matrix3d& rotation) {
  Matrix3d axes;
  axes << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  return axes * rotation * axes.transpose();
}

/// Weights in units of 1/255 with the sum 255: of all but the first, the nearest ones.
std::array<uint8_t, recon::SkinInfluence::kParts> weight_bytes(
    const recon::SkinInfluence& influence) {
  std::array<uint8_t, recon::SkinInfluence::kParts> bytes{};
  int rest = 255;
  for (size_t k = 1; k < bytes.size(); ++k) {
    const int weight = std::min(rest, static_cast<int>(std::lround(255 * influence.weight[k])));
    bytes[k] = static_cast<uint8_t>(weight);
    rest -= weight;
  }
  bytes[0] = static_cast<uint8_t>(rest);
  return bytes;
}

/// The skin of a tracked surface: its pulses, its number of vertices, and for each vertex four
/// numbers of joints and their weights, one byte each.
Json skin_json(const std::vector<int64_t>& pulses, const recon::Skin& skin) {
  std::vector<uint8_t> bytes;
  for (const recon::SkinInfluence& influence : skin.influences) {
    const auto weights = weight_bytes(influence);
    for (size_t k = 0; k < weights.size(); ++k) {
      bytes.push_back(weights[k] > 0 ? static_cast<uint8_t>(influence.part[k]) : uint8_t{0});
    }
    bytes.insert(bytes.end(), weights.begin(), weights.end());
  }
  return {{"pulses", pulses}, {"vertices", skin.influences.size()}, {"weights", base64(bytes)}};
}

double rounded(double value, double step) { return std::round(value / step) * step; }

/// Angles about z, x and y, radians, with `rotation` = Rz Rx Ry. Of all these, the ones nearest to
/// `near`: programs that filter or resample the channels of BVH take them for numbers on a line.
Vector3d angles_near(const Vector3d& near, const Matrix3d& rotation) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const double sine = std::clamp(rotation(2, 1), -1.0, 1.0);
  const bool is_locked = 1 - std::abs(sine) < 1e-9;  // z and y turn about one axis
  const Vector3d angles =
      is_locked ? Vector3d(std::atan2(rotation(1, 0), rotation(0, 0)), std::asin(sine), 0)
                : Vector3d(std::atan2(-rotation(0, 1), rotation(1, 1)), std::asin(sine),
                           std::atan2(-rotation(2, 0), rotation(2, 2)));
  const Vector3d others =
      angles.cwiseProduct(Vector3d(1, -1, 1)) + Vector3d::Constant(std::numbers::pi);
  const auto unwrapped = [&](const Vector3d& candidate) {
    return Vector3d(candidate + kTurn * ((near - candidate) / kTurn).array().round().matrix());
  };
  const Vector3d a = unwrapped(angles), b = unwrapped(others);
  return (a - near).lpNorm<1>() <= (b - near).lpNorm<1>() ? a : b;
}

class BvhWriter {
 public:
  explicit BvhWriter(const TakeSkeleton& skeleton) : skeleton_(skeleton) {}

  /// Throws InputError for too many rows.
  std::string write() {
    text_ = "HIERARCHY\n";
    write_joint(recon::kPelvis, 0);
    angles_.assign(order_.size(), Vector3d::Zero());
    const auto& pulses = skeleton_.structure.pulses;
    const double rate = skeleton_.rate_hz > 0 ? skeleton_.rate_hz : 25;
    const int64_t frames = rows();
    text_ += fmt::format("MOTION\nFrames: {}\nFrame Time: {:.10f}\n", frames, 1 / rate);
    for (size_t n = 0; n < pulses.size(); ++n) {
      if (n > 0) write_between(pulses[n - 1], pulses[n]);
      write_pulse(pulses[n]);
    }
    return text_;
  }

 private:
  /// The offset of a joint from its parent in the rest pose, in the frame of the parent: the mean
  /// over the take, with the length of the bone. The frames of parents stand upright at rest.
  Vector3d offset(Joint joint) const {
    Vector3d sum = Vector3d::Zero();
    const Joint from = skeleton_.structure.parent_of(joint);
    for (const recon::SkeletonPulse& pulse : skeleton_.structure.pulses) {
      sum += pulse.rotations[from].transpose() * (pulse.joints[joint] - pulse.joints[from]);
    }
    const double length = skeleton_.structure.pulses.empty() ? 0 : sum.norm();
    if (length < 1e-9) return Vector3d::Zero();
    return mean_length(joint) / length * sum;
  }

  double mean_length(Joint joint) const {
    double sum = 0;
    const Joint from = skeleton_.structure.parent_of(joint);
    for (const recon::SkeletonPulse& pulse : skeleton_.structure.pulses) {
      sum += (pulse.joints[joint] - pulse.joints[from]).norm();
    }
    return sum / static_cast<double>(skeleton_.structure.pulses.size());
  }

  void write_joint(Joint joint, int depth) {
    const std::string indent(static_cast<size_t>(depth), '\t');
    const Vector3d at = joint == recon::kPelvis ? Vector3d(Vector3d::Zero()) : y_up(offset(joint));
    order_.push_back(joint);
    text_ += fmt::format("{}{} {}\n{}{{\n{}\tOFFSET {:.6f} {:.6f} {:.6f}\n", indent,
                         depth == 0 ? "ROOT" : "JOINT", recon::name(joint), indent, indent, at.x(),
                         at.y(), at.z());
    text_ += indent + "\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n";
    bool has_child = false;
    for (size_t j = 1; j < joints_of(skeleton_); ++j) {
      const auto child = static_cast<Joint>(j);
      if (skeleton_.structure.parent_of(child) != joint) continue;
      has_child = true;
      write_joint(child, depth + 1);
    }
    if (!has_child) {
      text_ += indent + "\tEnd Site\n" + indent + "\t{\n" + indent + "\t\tOFFSET 0 0.05 0\n" +
               indent + "\t}\n";
    }
    text_ += indent + "}\n";
  }

  int64_t number(const recon::SkeletonPulse& pulse) const { return skeleton_.pulses[pulse.index]; }

  /// A file with a wrong pulse could have any number of lost ones, and each becomes a row.
  int64_t rows() const {
    constexpr int64_t kMaxRows = 1'000'000;
    const auto& pulses = skeleton_.structure.pulses;
    if (pulses.empty()) return 0;
    const int64_t first = number(pulses.front()), last = number(pulses.back());
    if (last - first < kMaxRows) return last - first + 1;
    throw InputError("--export bvh: a row for each pulse from " + std::to_string(first) + " to " +
                     std::to_string(last) + "; expected at most " + format_count(kMaxRows) +
                     ": choose some by --frames");
  }

  /// Rows for the pulses between two that follow each other: a row has no time of its own.
  void write_between(const recon::SkeletonPulse& before, const recon::SkeletonPulse& after) {
    const int64_t step = number(after) - number(before);
    for (int64_t n = 1; n < step; ++n) {
      write_pulse(
          recon::blended(before, after, static_cast<double>(n) / static_cast<double>(step)));
    }
  }

  /// The position of every joint in the frame of its parent: shoulders and hips move a little.
  void write_pulse(const recon::SkeletonPulse& pulse) {
    std::string separator;
    for (size_t i = 0; i < order_.size(); ++i) {
      const Joint joint = order_[i];
      const Joint from = skeleton_.structure.parent_of(joint);
      const bool is_root = joint == recon::kPelvis;
      const Matrix3d to_parent =
          is_root ? Matrix3d(Matrix3d::Identity()) : Matrix3d(pulse.rotations[from].transpose());
      const Vector3d origin = is_root ? Vector3d(Vector3d::Zero()) : pulse.joints[from];
      const Vector3d position = y_up(Vector3d(to_parent * (pulse.joints[joint] - origin)));
      angles_[i] = angles_near(angles_[i], y_up(Matrix3d(to_parent * pulse.rotations[joint])));
      const Vector3d angles = angles_[i] * 180 / std::numbers::pi;
      text_ += fmt::format("{}{:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f}", separator, position.x(),
                           position.y(), position.z(), angles.x(), angles.y(), angles.z());
      separator = " ";
    }
    text_ += '\n';
  }

  const TakeSkeleton& skeleton_;
  std::vector<Joint> order_;
  std::vector<Vector3d> angles_;  ///< of the row before, radians
  std::string text_;
};

}  // namespace

std::string skeleton_json(const TakeSkeleton& skeleton, bool skins) {
  const recon::KinematicStructure& structure = skeleton.structure;
  Json joints = Json::array(), pulses = Json::array();
  for (size_t j = 0; j < joints_of(skeleton); ++j) {
    const auto joint = static_cast<Joint>(j);
    Json entry{{"name", recon::name(joint)}, {"parent", nullptr}};
    if (j > 0) entry["parent"] = recon::name(structure.parent_of(joint));
    if (j > 0 && joint != recon::kPropBase) {
      entry["bone_m"] = rounded(structure.lengths.between(structure.parent_of(joint), joint), 1e-4);
    }
    joints.push_back(entry);
  }
  for (const recon::SkeletonPulse& pulse : structure.pulses) {
    Json positions = Json::array(), rotations = Json::array(), confidences = Json::array();
    for (size_t j = 0; j < joints_of(skeleton); ++j) {
      const Vector3d& p = pulse.joints[j];
      positions.push_back({rounded(p.x(), 1e-4), rounded(p.y(), 1e-4), rounded(p.z(), 1e-4)});
      const Eigen::Quaterniond q(pulse.rotations[j]);
      rotations.push_back(
          {rounded(q.w(), 1e-5), rounded(q.x(), 1e-5), rounded(q.y(), 1e-5), rounded(q.z(), 1e-5)});
      confidences.push_back(rounded(pulse.confidence[j], 1e-3));
    }
    pulses.push_back({{"pulse", skeleton.pulses[pulse.index]},
                      {"positions", positions},
                      {"rotations", rotations},
                      {"confidences", confidences}});
  }
  Json file{{"format", "v3d-skeleton"},
            {"version", 1},
            {"rate_hz", skeleton.rate_hz},
            {"stature_m", rounded(structure.lengths.stature_m(), 1e-3)},
            {"joints", joints},
            {"pulses", pulses}};
  for (size_t b = 0; skins && b < skeleton.skins.size(); ++b) {
    if (skeleton.skins[b].influences.empty()) continue;
    file["skins"].push_back(skin_json(skeleton.tracked[b].pulses, skeleton.skins[b]));
  }
  return file.dump() + "\n";
}

std::string skeleton_bvh(const TakeSkeleton& skeleton) { return BvhWriter(skeleton).write(); }

std::string skeleton_trc(const TakeSkeleton& skeleton, const std::string& name) {
  const auto& pulses = skeleton.structure.pulses;
  const size_t joints = joints_of(skeleton);
  const double rate = skeleton.rate_hz > 0 ? skeleton.rate_hz : 25;
  std::string text = "PathFileType\t4\t(X/Y/Z)\t" + name +
                     "\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
                     "OrigDataStartFrame\tOrigNumFrames\n";
  text += fmt::format("{0:g}\t{0:g}\t{1}\t{2}\tm\t{0:g}\t1\t{1}\nFrame#\tTime", rate, pulses.size(),
                      joints);
  for (size_t j = 0; j < joints; ++j) {
    text += fmt::format("\t{}\t\t", recon::name(static_cast<Joint>(j)));
  }
  text += "\n\t";
  for (size_t j = 1; j <= joints; ++j) text += fmt::format("\tX{0}\tY{0}\tZ{0}", j);
  text += "\n\n";
  for (size_t n = 0; n < pulses.size(); ++n) {
    const auto pulse = static_cast<double>(skeleton.pulses[pulses[n].index]);
    text += fmt::format("{}\t{:.6f}", n + 1, pulse / rate);
    for (size_t j = 0; j < joints; ++j) {
      // OpenSim: x forward, y up, z to the right.
      const Vector3d& p = pulses[n].joints[j];
      text += fmt::format("\t{:.6f}\t{:.6f}\t{:.6f}", p.x(), p.z(), -p.y());
    }
    text += '\n';
  }
  return text;
}

}  // namespace v3d::ctl
