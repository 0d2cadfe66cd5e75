#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/io/file.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using nlohmann::json;
using recon::Joint;

/// True positions of the main joints of a performer.
class TrueJoints {
 public:
  TrueJoints(const fs::path& file, int performer) : file_(file) {
    const json content = json::parse(read_file(file), nullptr, false);
    try {
      find_joints(content.at("joints"), performer);
      for (const json& pulse : content.at("pulses")) {
        positions_[pulse.at("pulse").get<int64_t>()] =
            pulse.at("positions").get<std::vector<std::array<double, 3>>>();
      }
    } catch (const json::exception&) {
      throw InputError(file.string() + ": is no joints.json of v3d-sim take --truth");
    }
    if (std::ranges::none_of(index_, [](const auto& index) { return index.has_value(); })) {
      throw InputError(file.string() + ": has no main joint of performer " +
                       std::to_string(performer) + "; expected joints with \"main\"");
    }
  }

  bool has(int64_t pulse) const { return positions_.contains(pulse); }

  /// Empty where the file has no such joint.
  std::optional<Vector3d> position(int64_t pulse, size_t joint) const {
    if (!index_[joint]) return {};
    const auto& positions = positions_.at(pulse);
    if (*index_[joint] >= positions.size()) {
      throw InputError(file_.string() + ": pulse " + std::to_string(pulse) +
                       " has fewer positions than there are joints");
    }
    const auto& [x, y, z] = positions[*index_[joint]];
    return Vector3d(x, y, z);
  }

 private:
  void find_joints(const json& joints, int performer) {
    for (size_t i = 0; i < joints.size(); ++i) {
      if (joints[i].value("performer", 1) != performer) continue;
      const std::string main = joints[i].value("main", "");
      for (size_t j = 0; j < recon::kBodyJoints; ++j) {
        if (main == recon::name(static_cast<Joint>(j))) index_[j] = i;
      }
    }
  }

  const fs::path file_;
  std::array<std::optional<size_t>, recon::kBodyJoints> index_;  ///< in the file
  std::map<int64_t, std::vector<std::array<double, 3>>> positions_;
};

/// The same joint of the other side; joints of the middle have themselves.
size_t mirrored(size_t joint) {
  std::string name(recon::name(static_cast<Joint>(joint)));
  if (name.starts_with("left_")) {
    name.replace(0, 4, "right");
  } else if (name.starts_with("right_")) {
    name.replace(0, 5, "left");
  }
  for (size_t j = 0; j < recon::kBodyJoints; ++j) {
    if (name == recon::name(static_cast<Joint>(j))) return j;
  }
  return joint;
}

JointError error_of(const std::vector<double>& millimetres) {
  return {percentile(millimetres, 0.5), percentile(millimetres, 0.9)};
}

}  // namespace

void require_true_joints(const fs::path& truth, int performer) {
  const TrueJoints joints(truth / "joints.json", performer);
}

SkeletonError compare_with_truth(const TakeSkeleton& skeleton, const fs::path& truth,
                                 int performer) {
  constexpr double kMillimetres = 1000;
  const TrueJoints joints(truth / "joints.json", performer);
  SkeletonError error;
  std::array<std::vector<double>, recon::kBodyJoints> of_joint;
  std::vector<double> all;
  for (const recon::SkeletonPulse& pulse : skeleton.structure.pulses) {
    const int64_t number = skeleton.pulses[pulse.index];
    if (!joints.has(number)) continue;
    ++error.pulses;
    double sum = 0, exchanged = 0;
    for (size_t j = 0; j < recon::kBodyJoints; ++j) {
      const auto position = joints.position(number, j);
      if (!position) continue;
      const double far = kMillimetres * (pulse.joints[j] - *position).norm();
      of_joint[j].push_back(far);
      all.push_back(far);
      sum += far;
      exchanged += kMillimetres * (pulse.joints[mirrored(j)] - *position).norm();
    }
    if (exchanged < sum) ++error.swaps;
  }
  if (error.pulses == 0) {
    throw InputError((truth / "joints.json").string() + ": has no pulse with a skeleton");
  }
  error.all = error_of(all);
  for (size_t j = 0; j < recon::kBodyJoints; ++j) {
    if (of_joint[j].empty()) continue;
    error.of_joint.emplace(recon::name(static_cast<Joint>(j)), error_of(of_joint[j]));
  }
  return error;
}

double bone_length_spread(const TakeSkeleton& skeleton) {
  double spread = 0;
  for (size_t j = 1; j < recon::kBodyJoints; ++j) {
    const auto joint = static_cast<Joint>(j);
    std::vector<double> lengths;
    for (const recon::SkeletonPulse& pulse : skeleton.structure.pulses) {
      lengths.push_back((pulse.joints[joint] - pulse.joints[recon::parent(joint)]).norm());
    }
    const auto [least, most] = std::ranges::minmax_element(lengths);
    spread = std::max(spread, (*most - *least) / median(lengths));
  }
  return spread;
}

}  // namespace v3d::ctl
