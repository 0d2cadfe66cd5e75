#include "recon/skeleton/kinematic_structure.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "recon/skeleton/body_evidence.h"
#include "recon/skeleton/body_model.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

constexpr int kFirstIterations = 30, kIterations = 10;
constexpr double kMinProp = 0.6;       ///< share of pulses with a prop
constexpr double kMaxFreeHands = 0.2;  ///< share of pulses where a hand is free and both hold it
constexpr double kHeadWeight = 20, kAnkleWeight = 20, kHandWeight = 10, kPropWeight = 20,
                 kBalanceWeight = 8;
/// Middle of the hands behind the base of the prop, and least distance of hands in front of the
/// neck: shares of the stature.
constexpr double kRightGrip = 0.06, kLeftGrip = 0.125, kInFront = 0.12;
/// Distance of the left wrist from a prop in the left hand, as a share of that of the right wrist.
/// Where both hands hold the prop, the right one is nearer to its base.
constexpr double kHolds = 0.5;
constexpr double kMaxTurn = 0.6;  ///< of a body from one pulse to the next, radians
/// The body turns by this part of the way to the toes in a pulse; feet whose directions have a sum
/// of less than the second do not count.
constexpr double kTowardsToes = 0.2, kToesAgree = 0.9;
constexpr double kMaxJumpM = 0.25;  ///< of an end from one pulse to the next
/// A pose is not carried over a gap of more pulses, nor over one in which the body moves farther.
constexpr int64_t kMaxCarried = 40;
constexpr double kMaxCarriedM = 0.6;
/// Weights of the poses of neighbours in a smoothed one, by the pulses between.
constexpr std::array<double, 3> kSmoothing{1, 0.5, 0.15};
constexpr int kOutlineIterations = 2;  ///< of learning the outline
constexpr double kConfidentM = 0.05;

Vector3d horizontal(const Vector3d& v) {
  const Vector3d flat(v.x(), v.y(), 0);
  const double length = flat.norm();
  return length > 1e-9 ? Vector3d(flat / length) : Vector3d(Vector3d::Zero());
}

Vector3d forward_of(const JointPositions& joints) {
  const Vector3d left =
      joints[kLeftShoulder] - joints[kRightShoulder] + joints[kLeftHip] - joints[kRightHip];
  return horizontal(left.cross(Vector3d::UnitZ()));
}

/// Numbers of a take that hold for all its pulses.
struct TakeFacts {
  double stature_m = 0, prop_m = 0;
  bool has_prop = false, both_hands_hold = false;
};

TakeFacts facts_of(const std::vector<SeenPulse>& seen) {
  std::vector<double> heights, all_heights, lengths;
  size_t props = 0, free_hands = 0;
  for (const SeenPulse& one : seen) {
    const BodyEvidence& pulse = *one.evidence;
    all_heights.push_back(pulse.top_m - pulse.bottom_m);
    if (pulse.head) heights.push_back(all_heights.back());
    if (pulse.prop) lengths.push_back((pulse.prop->tip - pulse.prop->base).norm());
    props += pulse.prop ? 1 : 0;
    free_hands += pulse.hands.empty() ? 0 : 1;
  }
  const auto share = [&](size_t count) {
    return static_cast<double>(count) / static_cast<double>(seen.size());
  };
  TakeFacts facts;
  facts.stature_m = percentile(heights.empty() ? all_heights : heights, 0.75);
  facts.has_prop = share(props) >= kMinProp;
  facts.prop_m = facts.has_prop ? percentile(lengths, 0.5) : 0.3 * facts.stature_m;
  facts.both_hands_hold = facts.has_prop && share(free_hands) <= kMaxFreeHands;
  return facts;
}

/// Pulses first to last - 1, from each of which the pose is carried to the next.
struct Stretch {
  size_t first = 0, last = 0;
};

bool can_carry(const SeenPulse& from, const SeenPulse& to) {
  const int64_t elapsed = to.number - from.number;
  if (elapsed == 1) return true;
  const double moved = (to.evidence->centre - from.evidence->centre).norm();
  return elapsed <= kMaxCarried && moved <= kMaxCarriedM;
}

std::vector<Stretch> stretches_of(const std::vector<SeenPulse>& seen) {
  std::vector<Stretch> stretches;
  for (size_t n = 0; n < seen.size(); ++n) {
    if (n == 0 || !can_carry(seen[n - 1], seen[n])) stretches.push_back({n, n});
    stretches.back().last = n + 1;
  }
  return stretches;
}

/// Fits all pulses: those of a stretch one after the other from a start, then each again.
class TakeFit {
 public:
  explicit TakeFit(std::vector<SeenPulse> seen)
      : seen_(std::move(seen)),
        facts_(facts_of(seen_)),
        lengths_(facts_.stature_m, facts_.prop_m),
        outline_(body_outline(facts_.stature_m)),
        poses_(seen_.size()) {}

  KinematicStructure run() {
    for (const Stretch& stretch : stretches_of(seen_)) begin(stretch);
    const size_t start = choose_start({0, seen_.size()});
    for (int iteration = 0; iteration < kOutlineIterations; ++iteration) {
      learn_outline();
      refit();
    }
    return result(start);
  }

 private:
  const BodyEvidence& pulse(size_t n) const { return *seen_[n].evidence; }

  /// Pulses from the earlier of two to the later.
  int64_t elapsed(size_t a, size_t b) const { return std::abs(seen_[b].number - seen_[a].number); }

  void begin(const Stretch& stretch) {
    const auto heads =
        follow_head(std::span(seen_).subspan(stretch.first, stretch.last - stretch.first));
    heads_.insert(heads_.end(), heads.begin(), heads.end());
    const size_t start = choose_start(stretch);
    track(stretch, start, false);
    if (faces_backwards(stretch)) track(stretch, start, true);
  }

  size_t choose_start(const Stretch& stretch) const {
    size_t best = stretch.first;
    const auto score = [&](size_t n) {
      const BodyEvidence& seen = pulse(n);
      return seen.branches_m + (seen.is_good() ? 10 : 0) + (heads_[n].weight == 1 ? 20 : 0);
    };
    for (size_t n = best + 1; n < stretch.last; ++n) {
      if (score(n) > score(best)) best = n;
    }
    return best;
  }

  JointPositions first_pose(size_t n, bool turned) const {
    const BodyEvidence& seen = pulse(n);
    const Vector3d middle = seen.head.value_or(seen.centre);
    Vector3d forward = toes_of(seen);
    if (facts_.has_prop && seen.prop) forward = horizontal(seen.prop->base - middle);
    if (forward.norm() < 0.5) {
      for (const Vector3d& hand : seen.hands) forward += horizontal(hand - middle);
    }
    double yaw = std::atan2(forward.y(), forward.x());
    if (turned) yaw += std::numbers::pi;
    Vector3d pelvis = middle;
    if (seen.feet.size() == 2) {
      pelvis = 0.6 * pelvis + 0.2 * (seen.feet[0].centre + seen.feet[1].centre);
    }
    pelvis.z() = seen.bottom_m + 0.53 * facts_.stature_m;
    JointPositions pose = standing_pose(lengths_, pelvis, yaw);
    if (facts_.has_prop && seen.prop) {
      pose[kPropBase] = seen.prop->base;
      pose[kPropTip] = seen.prop->tip;
    }
    return pose;
  }

  void track(const Stretch& stretch, size_t start, bool turned) {
    FittedPose first{.joints = first_pose(start, turned)};
    for (int i = 0; i < 3; ++i) {
      first = fit(start, first.joints, first.joints, 0.3, kFirstIterations);
    }
    poses_[start] = first;
    for (size_t n = start + 1; n < stretch.last; ++n) carry(n - 1, n);
    for (size_t n = start; n-- > stretch.first;) carry(n + 1, n);
  }

  /// Positions of the right and the left hand on the prop. The right hand is nearer to the tip.
  std::pair<Vector3d, Vector3d> grips(const PropEvidence& prop) const {
    const Vector3d along = (prop.tip - prop.base).normalized();
    return {prop.base - kRightGrip * facts_.stature_m * along,
            prop.base - kLeftGrip * facts_.stature_m * along};
  }

  /// Horizontal direction to hands that hold a prop in front of the body: it shows how the body
  /// turns. Empty where they are above the head or not known.
  std::optional<Vector3d> towards_hands(const BodyEvidence& seen, const Vector3d& neck) const {
    if (!facts_.both_hands_hold || !seen.prop) return {};
    const auto [right, left] = grips(*seen.prop);
    const Vector3d away = 0.5 * (right + left) - neck;
    if (away.head<2>().norm() < kInFront * facts_.stature_m) return {};
    return horizontal(away);
  }

  /// From `a` to `b` about the vertical axis, radians.
  static double angle_between(const Vector3d& a, const Vector3d& b) {
    return std::atan2(a.cross(b).z(), a.head<2>().dot(b.head<2>()));
  }

  /// Turns a body about its vertical axis, if not by more than one can turn in `pulses`.
  static void turn(JointPositions& joints, double angle, int64_t pulses) {
    if (std::abs(angle) > kMaxTurn * static_cast<double>(pulses)) return;
    const Eigen::AngleAxisd rotation(angle, Vector3d::UnitZ());
    const Vector3d centre = joints[kPelvis];
    for (Vector3d& joint : joints) joint = centre + rotation * (joint - centre);
  }

  void carry(size_t from, size_t to) {
    JointPositions expected = poses_[from].joints;
    const BodyEvidence& before = pulse(from);
    const BodyEvidence& now = pulse(to);
    const auto a = towards_hands(before, expected[kNeck]);
    const auto b = towards_hands(now, expected[kNeck]);
    if (a && b) {
      turn(expected, angle_between(*a, *b), elapsed(from, to));
    } else if (!facts_.both_hands_hold && toes_of(now).norm() > kToesAgree) {
      turn(expected, kTowardsToes * angle_between(forward_of(expected), toes_of(now)),
           elapsed(from, to));
    }
    poses_[to] = fit(to, expected, expected, 0.6, kIterations + 5);
  }

  /// The ankles of both feet, left then right, from feet near the expected ankles.
  void add_feet(const BodyEvidence& seen, const JointPositions& expected,
                std::vector<JointTarget>& targets) const {
    using namespace proportions;
    const Vector3d forward = forward_of(expected);
    std::vector<Vector3d> ankles;
    for (const FootEvidence& foot : seen.feet) {
      const double length = std::min(foot.length_m, 1.1 * kFootLength * facts_.stature_m);
      const Vector3d ahead = foot.axis.dot(forward) < 0 ? Vector3d(-foot.axis) : foot.axis;
      // The ankle lies at a quarter of the foot.
      Vector3d ankle = foot.centre - 0.25 * length * ahead;
      ankle.z() += kAnkle * facts_.stature_m;
      ankles.push_back(ankle);
    }
    const double reach = ankles.size() == 2 ? 0.6 : kMaxJumpM;
    const auto far = [&](size_t foot, Joint joint) {
      return (ankles[foot] - expected[joint]).norm();
    };
    const auto add = [&](size_t foot, Joint joint) {
      if (far(foot, joint) < reach) targets.push_back({joint, ankles[foot], kAnkleWeight});
    };
    if (ankles.size() == 2) {
      const bool crossed =
          far(0, kLeftAnkle) + far(1, kRightAnkle) > far(1, kLeftAnkle) + far(0, kRightAnkle);
      add(crossed ? 1 : 0, kLeftAnkle);
      add(crossed ? 0 : 1, kRightAnkle);
    } else if (ankles.size() == 1) {
      add(0, far(0, kLeftAnkle) < far(0, kRightAnkle) ? kLeftAnkle : kRightAnkle);
    }
  }

  /// The pelvis is above the middle between neck and feet: otherwise a person falls.
  void add_balance(const HeadPosition& head, const JointPositions& expected,
                   std::vector<JointTarget>& targets) const {
    const Vector3d neck = head.weight > 0 ? head.neck : expected[kNeck];
    Vector3d feet = Vector3d::Zero();
    for (const Joint ankle : {kLeftAnkle, kRightAnkle}) {
      Vector3d position = expected[ankle];
      for (const JointTarget& target : targets) {
        if (target.joint == ankle) position = target.position;
      }
      feet += 0.5 * position;
    }
    Vector3d down = 0.5 * (feet - neck);
    down.z() = -lengths_.between(kPelvis, kNeck);
    const Vector3d pelvis = neck + lengths_.between(kPelvis, kNeck) * down.normalized();
    targets.push_back({kPelvis, pelvis, kBalanceWeight});
  }

  void add_wrist(const Vector3d& grip, Joint wrist, const JointPositions& expected,
                 std::vector<JointTarget>& targets) const {
    const Joint shoulder = wrist == kLeftWrist ? kLeftShoulder : kRightShoulder;
    const Vector3d towards = (expected[shoulder] - grip).normalized();
    const Vector3d position = grip + proportions::kGrip * facts_.stature_m * towards;
    targets.push_back({wrist, position, kHandWeight});
  }

  void add_hands(const BodyEvidence& seen, const JointPositions& expected,
                 PoseProblem& problem) const {
    if (facts_.both_hands_hold) {
      if (!seen.prop) return;
      const auto [right, left] = grips(*seen.prop);
      add_wrist(right, kRightWrist, expected, problem.targets);
      add_wrist(left, kLeftWrist, expected, problem.targets);
      problem.towards_hands = towards_hands(seen, expected[kNeck]);
      return;
    }
    for (const Vector3d& hand : seen.hands) {
      const double left = (hand - expected[kLeftWrist]).norm();
      const double right = (hand - expected[kRightWrist]).norm();
      if (std::min(left, right) > 2 * kMaxJumpM) continue;
      add_wrist(hand, left < right ? kLeftWrist : kRightWrist, expected, problem.targets);
    }
  }

  FittedPose fit(size_t n, const JointPositions& start, const JointPositions& expected,
                 double expected_weight, int iterations) const {
    const BodyEvidence& seen = pulse(n);
    PoseProblem problem;
    problem.points = seen.points;
    problem.expected = expected;
    problem.expected_weight = expected_weight;
    problem.has_prop = facts_.has_prop;
    const HeadPosition& head = heads_[n];
    if (head.weight > 0) {
      problem.targets.push_back({kHead, head.head, kHeadWeight * head.weight});
      problem.targets.push_back({kNeck, head.neck, kHeadWeight * head.weight});
    }
    add_feet(seen, expected, problem.targets);
    add_balance(heads_[n], expected, problem.targets);
    add_hands(seen, expected, problem);
    if (facts_.has_prop && seen.prop) {
      problem.targets.push_back({kPropBase, seen.prop->base, kPropWeight});
      problem.targets.push_back({kPropTip, seen.prop->tip, kPropWeight});
    }
    return fit_pose(problem, lengths_, outline_, start, iterations);
  }

  /// Sum of the directions to the toes, as far as feet show them.
  static Vector3d toes_of(const BodyEvidence& seen) {
    Vector3d sum = Vector3d::Zero();
    for (const FootEvidence& foot : seen.feet) {
      if (foot.points_ahead) sum += foot.axis;
    }
    return sum;
  }

  /// Do most feet point backwards? Then left and right are exchanged.
  bool faces_backwards(const Stretch& stretch) const {
    if (facts_.both_hands_hold) return false;
    double sum = 0;
    for (size_t n = stretch.first; n < stretch.last; ++n) {
      sum += toes_of(pulse(n)).dot(forward_of(poses_[n].joints));
    }
    return sum < 0;
  }

  /// Radii of the outline: medians over the take.
  void learn_outline() {
    std::vector<std::array<std::vector<double>, Capsule::kKnots>> samples(outline_.size());
    for (size_t n = 0; n < poses_.size(); ++n) {
      for (const OutlinePoint& point : pulse(n).points) {
        const auto [capsule, distance] = nearest(point, poses_[n].joints);
        const auto knot = static_cast<size_t>(distance.along * (Capsule::kKnots - 1) + 0.5);
        samples[capsule][knot].push_back(distance.metres);
      }
    }
    for (size_t c = 0; c < outline_.size(); ++c) {
      for (size_t k = 0; k < Capsule::kKnots; ++k) {
        if (samples[c][k].size() < 30) continue;
        outline_[c].radius_m[k] = percentile(samples[c][k], 0.5);
      }
    }
    make_symmetric();
  }

  std::pair<size_t, CapsuleDistance> nearest(const OutlinePoint& point,
                                             const JointPositions& joints) const {
    if (point.capsule != OutlinePoint::kAnyCapsule) {
      const auto only = static_cast<size_t>(point.capsule);
      return {only, distance_to(outline_[only], joints, point.position)};
    }
    std::pair<size_t, CapsuleDistance> best;
    double least = 1e9;
    for (size_t c = 0; c < kPropCapsule; ++c) {
      const CapsuleDistance distance = distance_to(outline_[c], joints, point.position);
      const double outside = std::abs(distance.metres - outline_[c].radius(distance.along));
      if (outside >= least) continue;
      least = outside;
      best = {c, distance};
    }
    return best;
  }

  void make_symmetric() {
    for (const auto& [left, right] :
         {std::pair<size_t, size_t>{2, 4}, {3, 5}, {7, 9}, {8, 10}, {11, 13}, {12, 14}}) {
      for (size_t k = 0; k < Capsule::kKnots; ++k) {
        const double mean = 0.5 * (outline_[left].radius_m[k] + outline_[right].radius_m[k]);
        outline_[left].radius_m[k] = outline_[right].radius_m[k] = mean;
      }
    }
  }

  /// Fits all pulses again, near the mean of a pulse and its neighbours.
  void refit() {
    std::vector<FittedPose> refined(poses_.size());
    tbb::parallel_for(size_t{0}, poses_.size(), [&](size_t n) {
      refined[n] = fit(n, poses_[n].joints, mean_with_neighbours(n), 1, kIterations);
    });
    poses_ = std::move(refined);
  }

  /// No mean across a gap: a performer can be elsewhere behind it.
  JointPositions mean_with_neighbours(size_t n) const {
    JointPositions mean = poses_[n].joints;
    if (n == 0 || n + 1 >= poses_.size() || elapsed(n - 1, n + 1) != 2) return mean;
    for (size_t j = 0; j < kJoints; ++j) {
      mean[j] = 0.5 * mean[j] + 0.25 * (poses_[n - 1].joints[j] + poses_[n + 1].joints[j]);
    }
    return mean;
  }

  JointPositions smoothed(size_t n) const {
    JointPositions sum = poses_[n].joints;
    double weights = kSmoothing[0];
    for (const int step : {-2, -1, 1, 2}) {
      const auto other = static_cast<std::ptrdiff_t>(n) + step;
      if (other < 0 || other >= static_cast<std::ptrdiff_t>(poses_.size())) continue;
      const auto at = static_cast<size_t>(other);
      if (elapsed(at, n) >= std::ssize(kSmoothing)) continue;
      const double weight = kSmoothing[static_cast<size_t>(elapsed(at, n))];
      for (size_t j = 0; j < kPropBase; ++j) sum[j] += weight * poses_[at].joints[j];
      weights += weight;
    }
    for (size_t j = 0; j < kPropBase; ++j) sum[j] /= weights;
    restore_lengths(lengths_, sum);
    return sum;
  }

  KinematicStructure result(size_t start) const {
    KinematicStructure structure;
    structure.lengths = lengths_;
    structure.outline = outline_;
    structure.has_prop = facts_.has_prop;
    structure.start = seen_[start].index;
    for (size_t n = 0; n < poses_.size(); ++n) {
      SkeletonPulse skeleton;
      skeleton.index = seen_[n].index;
      skeleton.joints = smoothed(n);
      skeleton.rotations = joint_rotations(skeleton.joints);
      for (size_t j = 0; j < kJoints; ++j) {
        const double ratio = poses_[n].residual_m[j] / kConfidentM;
        const double support = static_cast<double>(poses_[n].support[j]);
        skeleton.confidence[j] = std::exp(-ratio * ratio) * support / (support + 10);
      }
      structure.pulses.push_back(skeleton);
      structure.good += pulse(n).is_good() ? 1 : 0;
      structure.upright += pulse(n).is_upright() ? 1 : 0;
    }
    if (facts_.has_prop) structure.prop_hand = hand_of_prop(structure.pulses);
    return structure;
  }

  std::vector<SeenPulse> seen_;
  TakeFacts facts_;
  BodyLengths lengths_;
  std::vector<Capsule> outline_;
  std::vector<FittedPose> poses_;
  std::vector<HeadPosition> heads_;
};

}  // namespace

Joint hand_of_prop(std::span<const SkeletonPulse> pulses) {
  const auto in_left = std::ranges::count_if(pulses, [](const SkeletonPulse& pulse) {
    const Vector3d& base = pulse.joints[kPropBase];
    return (pulse.joints[kLeftWrist] - base).norm() <=
           kHolds * (pulse.joints[kRightWrist] - base).norm();
  });
  return 2 * in_left > std::ssize(pulses) ? kLeftWrist : kRightWrist;
}

KinematicStructure kinematic_structure(std::span<const BodyEvidence> evidence,
                                       std::span<const int64_t> pulses) {
  V3D_CHECK(pulses.empty() || pulses.size() == evidence.size());
  std::vector<SeenPulse> seen;
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (!evidence[i].problem.empty()) continue;
    seen.push_back({i, pulses.empty() ? static_cast<int64_t>(i) : pulses[i], &evidence[i]});
  }
  if (seen.empty()) return {};
  return TakeFit(std::move(seen)).run();
}

}  // namespace v3d::recon
