#include "recon/editing/feet.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
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
constexpr std::array<Joint, 2> kAnkles{kLeftAnkle, kRightAnkle};
constexpr double kInsideM = 1e-9;  ///< farther outside of a ball is not in it
constexpr size_t kMaxPasses = 20;
constexpr double kStillM = 0.001;  ///< of a foot that slides by no more

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

/// The share of a correction `frames` frames beside a contact; 0 at fade + 1 frames.
double fading(size_t frames, size_t fade) {
  return 1 - smooth_step(static_cast<double>(frames) / static_cast<double>(fade + 1));
}

Matrix3d turn_between(const Vector3d& from, const Vector3d& to) {
  return Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

/// Lengths of the two bones of a leg, metres.
struct Leg {
  double thigh = 0, shin = 0;
  double longest() const { return (thigh + shin) * (1 - 1e-9); }
  double shortest() const { return std::abs(thigh - shin) + 1e-6; }
};

Leg leg_of(const SkeletonPulse& skeleton, Joint ankle) {
  const Joint knee = parent(ankle), hip = parent(knee);
  return {(skeleton.joints[knee] - skeleton.joints[hip]).norm(),
          (skeleton.joints[ankle] - skeleton.joints[knee]).norm()};
}

/// Turns thigh and shin so that the ankle reaches `target`, if it can.
void reach(SkeletonPulse& skeleton, Joint ankle, const Vector3d& target) {
  const Joint knee = parent(ankle), hip = parent(knee);
  const Vector3d root = skeleton.joints[hip];
  const Vector3d thigh = skeleton.joints[knee] - root;
  const Vector3d shin = skeleton.joints[ankle] - skeleton.joints[knee];
  const Leg leg = leg_of(skeleton, ankle);
  const double a = leg.thigh, b = leg.shin;
  Vector3d line = target - root;
  const double distance = std::clamp(line.norm(), leg.shortest(), leg.longest());
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

/// How far both ankles of a frame move, metres.
using AnkleMoves = std::array<Vector3d, kAnkles.size()>;

/// Adds the moves of an ankle in a contact to its mean position, and, by less and less, in the
/// `fade` frames before and after. They are along the floor: the ankle keeps its height.
void add_moves(const Clip& clip, const std::vector<FootContact>& contacts,
               const FootContact& contact, size_t fade, std::vector<AnkleMoves>& moves) {
  const auto [first, last] = contact.range;
  const size_t side = contact.ankle == kAnkles[0] ? 0 : 1;
  const Vector3d mean = mean_position(clip, contact);
  const auto to_mean = [&](size_t f) {
    Vector3d by = mean - position_of(clip, f, contact.ankle);
    by.z() = 0;
    return by;
  };
  const auto is_free = [&](size_t f) {
    return std::ranges::none_of(contacts, [&](const FootContact& other) {
      return other.ankle == contact.ankle && f >= other.range.first && f < other.range.last;
    });
  };
  for (size_t k = 1; k <= fade && k <= first && is_free(first - k); ++k) {
    moves[first - k][side] += fading(k, fade) * to_mean(first);
  }
  for (size_t f = first; f < last; ++f) moves[f][side] += to_mean(f);
  for (size_t k = 1; k <= fade && last - 1 + k < clip.frames.size() && is_free(last - 1 + k); ++k) {
    moves[last - 1 + k][side] += fading(k, fade) * to_mean(last - 1);
  }
}

std::vector<AnkleMoves> ankle_moves(const Clip& clip, const std::vector<FootContact>& contacts,
                                    size_t fade) {
  const AnkleMoves none{Vector3d::Zero(), Vector3d::Zero()};
  std::vector<AnkleMoves> moves(clip.frames.size(), none);
  for (const FootContact& contact : contacts) add_moves(clip, contacts, contact, fade, moves);
  return moves;
}

/// A ball in space.
struct Ball {
  Vector3d centre = Vector3d::Zero();
  double radius = 0;

  bool contains(const Vector3d& p) const { return (p - centre).norm() <= radius + kInsideM; }
  Vector3d nearest(const Vector3d& p) const {
    return contains(p) ? p : Vector3d(centre + radius * (p - centre).normalized());
  }
};

/// The point of both balls that is nearest to `p`. Where the balls do not meet, a point between
/// them.
Vector3d nearest_in_both(const Ball& a, const Ball& b, const Vector3d& p) {
  if (const Vector3d in_a = a.nearest(p); b.contains(in_a)) return in_a;
  if (const Vector3d in_b = b.nearest(p); a.contains(in_b)) return in_b;
  // Otherwise it lies on the circle in which both spheres meet.
  const Vector3d between = b.centre - a.centre;
  const double distance = between.norm();
  const Vector3d line = between / distance;
  const double along =
      (a.radius * a.radius - b.radius * b.radius + distance * distance) / (2 * distance);
  const double radius = std::sqrt(std::max(0.0, a.radius * a.radius - along * along));
  const Vector3d middle = a.centre + along * line;
  const Vector3d side = p - middle - line.dot(p - middle) * line;
  return side.norm() < kInsideM ? middle : Vector3d(middle + radius * side.normalized());
}

/// The shifts of the body with which a leg reaches the moved ankle.
Ball reachable(const SkeletonPulse& skeleton, Joint ankle, const Vector3d& move) {
  const Vector3d& hip = skeleton.joints[parent(parent(ankle))];
  return {Vector3d(skeleton.joints[ankle] + move - hip), leg_of(skeleton, ankle).longest()};
}

/// The shift of the body nearest to `wanted` with which both legs of a frame reach their ankles.
Vector3d nearest_shift(const Clip& clip, size_t frame, const AnkleMoves& moves,
                       const Vector3d& wanted) {
  const SkeletonPulse& skeleton = clip.frames[frame].skeleton;
  return nearest_in_both(reachable(skeleton, kAnkles[0], moves[0]),
                         reachable(skeleton, kAnkles[1], moves[1]), wanted);
}

/// The shift of the body in each frame, so that both legs reach the moved ankles. Each shift also
/// acts, by less and less, in the `fade` frames before and after: otherwise the body would jump.
std::vector<Vector3d> body_shifts(const Clip& clip, const std::vector<AnkleMoves>& moves,
                                  size_t fade) {
  const size_t frames = clip.frames.size();
  std::vector<Vector3d> least(frames), shifts(frames);
  for (size_t f = 0; f < frames; ++f) {
    least[f] = nearest_shift(clip, f, moves[f], Vector3d::Zero());
  }
  for (size_t f = 0; f < frames; ++f) {
    Vector3d largest = least[f];
    const size_t end = std::min(f + fade + 1, frames);
    for (size_t other = f > fade ? f - fade : 0; other < end; ++other) {
      const Vector3d faded = fading(other > f ? other - f : f - other, fade) * least[other];
      if (faded.norm() > largest.norm()) largest = faded;
    }
    shifts[f] = nearest_shift(clip, f, moves[f], largest);
  }
  return shifts;
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
  const std::vector<AnkleMoves> moves = ankle_moves(clip, contacts, fade);
  const std::vector<Vector3d> shifts = body_shifts(clip, moves, fade);
  for (size_t f = 0; f < clip.frames.size(); ++f) {
    const bool stays = moves[f][0].isZero() && moves[f][1].isZero() && shifts[f].isZero();
    if (stays) continue;
    SkeletonPulse skeleton = clip.frames[f].skeleton;
    for (Vector3d& joint : skeleton.joints) joint += shifts[f];
    for (size_t side = 0; side < kAnkles.size(); ++side) {
      reach(skeleton, kAnkles[side], position_of(clip, f, kAnkles[side]) + moves[f][side]);
    }
    pose(clip, clip.frames[f], skeleton);
  }
}

void hold_all_feet(Clip& clip, size_t fade, const std::function<void()>& on_pass) {
  std::vector<FootContact> contacts = foot_contacts(clip);
  for (size_t n = 0; n < kMaxPasses && foot_slide(clip, contacts) > kStillM; ++n) {
    on_pass();
    hold_feet(clip, contacts, fade);
    contacts = foot_contacts(clip);
  }
}

}  // namespace v3d::recon
