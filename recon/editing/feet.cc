#include "recon/editing/feet.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/core/statistics.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kAboveLowestM = 0.04, kMaxSpeed = 0.35;  ///< metres, metres per second
constexpr size_t kMinFrames = 4;
constexpr double kLowest = 0.05;  ///< part of the frames in which an ankle is at its lowest

const Vector3d& position_of(const Clip& clip, size_t frame, Joint joint) {
  return clip.frames[frame].skeleton.joints[joint];
}

Vector3d mean_position(const Clip& clip, const FootContact& contact) {
  Vector3d sum = Vector3d::Zero();
  for (size_t f = contact.range.first; f < contact.range.last; ++f) {
    sum += position_of(clip, f, contact.ankle);
  }
  return sum / static_cast<double>(contact.range.last - contact.range.first);
}

void add_contacts(const Clip& clip, Joint ankle, std::vector<FootContact>& contacts) {
  std::vector<double> heights;
  for (size_t f = 0; f < clip.frames.size(); ++f)
    heights.push_back(position_of(clip, f, ankle).z());
  const double highest = percentile(heights, kLowest) + kAboveLowestM;
  const auto stands = [&](size_t f) {
    if (heights[f] > highest) return false;
    const size_t before = f > 0 ? f - 1 : f, after = std::min(f + 1, clip.frames.size() - 1);
    const Vector3d step = position_of(clip, after, ankle) - position_of(clip, before, ankle);
    const double seconds = static_cast<double>(std::max<size_t>(after - before, 1)) / clip.rate_hz;
    return step.head<2>().norm() <= kMaxSpeed * seconds;
  };
  for (size_t f = 0; f < clip.frames.size(); ++f) {
    if (!stands(f)) continue;
    size_t last = f;
    while (last < clip.frames.size() && stands(last)) ++last;
    if (last - f >= kMinFrames) contacts.push_back({ankle, {f, last}});
    f = last;
  }
}

Matrix3d turn_between(const Vector3d& from, const Vector3d& to) {
  return Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

/// Turns thigh and shin so that the ankle reaches `target`, if it can.
void reach(SkeletonPulse& skeleton, Joint ankle, const Vector3d& target) {
  const Joint knee = parent(ankle), hip = parent(knee);
  const Vector3d root = skeleton.joints[hip];
  const Vector3d thigh = skeleton.joints[knee] - root;
  const Vector3d shin = skeleton.joints[ankle] - skeleton.joints[knee];
  const double a = thigh.norm(), b = shin.norm();
  Vector3d line = target - root;
  const double distance = std::clamp(line.norm(), std::abs(a - b) + 1e-6, (a + b) * (1 - 1e-9));
  if (line.norm() < 1e-6) return;
  line.normalize();
  const double along = (a * a - b * b + distance * distance) / (2 * distance);
  const double aside = std::sqrt(std::max(0.0, a * a - along * along));
  Vector3d side = thigh - thigh.dot(line) * line;
  if (side.norm() < 1e-6) side = skeleton.rotations[hip].col(0);
  side = (side - side.dot(line) * line).normalized();
  const Vector3d new_knee = root + along * line + aside * side;
  const Vector3d new_ankle = root + distance * line;
  skeleton.rotations[hip] = turn_between(thigh, new_knee - root) * skeleton.rotations[hip];
  skeleton.rotations[knee] = turn_between(shin, new_ankle - new_knee) * skeleton.rotations[knee];
  skeleton.joints[knee] = new_knee;
  skeleton.joints[ankle] = new_ankle;
}

}  // namespace

std::vector<FootContact> foot_contacts(const Clip& clip) {
  std::vector<FootContact> contacts;
  if (clip.frames.empty()) return contacts;
  add_contacts(clip, kLeftAnkle, contacts);
  add_contacts(clip, kRightAnkle, contacts);
  return contacts;
}

double foot_slide(const Clip& clip, const std::vector<FootContact>& contacts) {
  double slide = 0;
  for (const FootContact& contact : contacts) {
    const Vector3d mean = mean_position(clip, contact);
    for (size_t f = contact.range.first; f < contact.range.last; ++f) {
      slide = std::max(slide, (position_of(clip, f, contact.ankle) - mean).head<2>().norm());
    }
  }
  return slide;
}

void hold_feet(Clip& clip, const std::vector<FootContact>& contacts, size_t fade) {
  for (const FootContact& contact : contacts) {
    const auto [first, last] = contact.range;
    const Vector3d mean = mean_position(clip, contact);
    // Corrections are along the floor, also where they fade: the ankle keeps its height.
    const auto correction = [&](size_t f) {
      Vector3d by = mean - position_of(clip, f, contact.ankle);
      by.z() = 0;
      return by;
    };
    const Vector3d at_begin = correction(first), at_end = correction(last - 1);
    const auto move = [&](size_t f, const Vector3d& by) {
      SkeletonPulse skeleton = clip.frames[f].skeleton;
      reach(skeleton, contact.ankle, skeleton.joints[contact.ankle] + by);
      pose(clip, clip.frames[f], skeleton);
    };
    const auto is_free = [&](size_t f) {
      return std::ranges::none_of(contacts, [&](const FootContact& other) {
        return other.ankle == contact.ankle && f >= other.range.first && f < other.range.last;
      });
    };
    const auto share = [&](size_t k) {
      return 1 - smooth_step(static_cast<double>(k) / static_cast<double>(fade + 1));
    };
    for (size_t k = 1; k <= fade && k <= first && is_free(first - k); ++k) {
      move(first - k, share(k) * at_begin);
    }
    for (size_t k = 1; k <= fade && last - 1 + k < clip.frames.size() && is_free(last - 1 + k);
         ++k) {
      move(last - 1 + k, share(k) * at_end);
    }
    for (size_t f = first; f < last; ++f) move(f, correction(f));
  }
}

}  // namespace v3d::recon
