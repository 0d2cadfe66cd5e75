#include "sim/performer/performer.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "sim/performer/motion.h"
#include "sim/rendering/scene.h"

namespace v3d::sim {
namespace {

double any_time() { return *rc::gen::inRange(0, 8000) * 1e-3 - 2; }

bool same_bytes(const Mesh& a, const Mesh& b) {
  return a.vertices == b.vertices && a.triangles == b.triangles && a.colours == b.colours;
}

TEST(Performer, has_a_sword_tip_with_a_peak_speed_of_about_15_metres_per_second) {
  constexpr double kStep = 1e-4;
  double peak = 0;
  for (double t = 0; t < kActionPeriodSeconds; t += 1e-3) {
    peak = std::max(peak, (sword_tip(pose_at(t + kStep)) - sword_tip(pose_at(t))).norm() / kStep);
  }
  EXPECT_GT(peak, 14);
  EXPECT_LT(peak, 17);
}

TEST(Performer, consists_of_closed_outward_oriented_parts) {
  for (const double t : {-0.7, 0.0, 0.4, 1.25, 2.6, 3.9}) {
    for (const Part& part : performer_parts(t, 1)) {
      EXPECT_TRUE(is_manifold(part.mesh)) << "at " << t;
      EXPECT_GT(enclosed_volume(part.mesh), 0) << "at " << t;
      EXPECT_EQ(part.paint.size(), part.mesh.vertices.size());
    }
  }
}

RC_GTEST_PROP(Performer, keeps_both_hands_at_the_handle_at_all_times, ()) {
  const Pose pose = pose_at(any_time());
  for (const Side side : {kLeft, kRight}) {
    const Eigen::Vector3d wrist = pose.world_from_sword.inverse() * pose.arm[side].tip;
    RC_ASSERT(wrist.head<2>().norm() < 0.09);
    RC_ASSERT(wrist.z() < 0.03 && wrist.z() > -kHandleLength - 0.06);
  }
}

RC_GTEST_PROP(Performer, stays_above_the_floor_and_inside_the_studio, ()) {
  for (const auto& v : performer_at(any_time(), 1).vertices) {
    RC_ASSERT(v.z() >= -0.001F && v.z() <= 2.45F);
    RC_ASSERT(v.head<2>().norm() < 1.5F);
  }
}

TEST(Performer, has_the_height_of_a_person) {
  float top = 0;
  for (const Part& part : performer_parts(0, 1)) {
    if (part.material == Material::kFace) {
      for (const auto& v : part.mesh.vertices) top = std::max(top, v.z());
    }
  }
  EXPECT_NEAR(top, 1.75, 0.07);  // top of the head; slightly bent knees
}

TEST(Performer, gives_the_same_bytes_for_the_same_time_and_seed) {
  EXPECT_TRUE(same_bytes(performer_at(1.25, 7), performer_at(1.25, 7)));
  EXPECT_FALSE(same_bytes(performer_at(1.25, 7), performer_at(1.25, 8)));
}

TEST(Performer, repeats_the_action_every_period) {
  // Times that are exact in binary, so that their remainders are exact, too.
  for (const double t : {0.0, 0.5, 1.25, 3.75}) {
    const Mesh once = performer_at(t, 1);
    const Mesh again = performer_at(t + kActionPeriodSeconds, 1);
    ASSERT_EQ(once.vertices.size(), again.vertices.size());
    for (size_t i = 0; i < once.vertices.size(); ++i) {
      ASSERT_LT((once.vertices[i] - again.vertices[i]).norm(), 1e-5F);
    }
  }
}

TEST(Performer, moves_without_jumps_also_at_the_end_of_the_period) {
  for (int i = 0; i < 4000; ++i) {
    const double t = 1e-3 * i;
    const double step = (sword_tip(pose_at(t + 1e-3)) - sword_tip(pose_at(t))).norm();
    ASSERT_LT(step, 0.017) << "at " << t;
  }
}

TEST(Performer, has_clothes_that_lag_behind_the_body) {
  // The hem of the trousers lags behind the foot: in the lunge it is further back than at rest.
  const auto hem_of = [](double t) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    int n = 0;
    for (const Part& part : performer_parts(t, 1)) {
      if (part.material != Material::kTrousers) continue;
      for (const auto& v : part.mesh.vertices) {
        if (v.z() < 0.3F) {
          sum += v;
          ++n;
        }
      }
    }
    return Eigen::Vector3f(sum / static_cast<float>(n));
  };
  const double lunge = 1.25;
  const auto feet_of = [](double t) {
    const Pose pose = pose_at(t);
    return Eigen::Vector3d(0.5 * (pose.leg[kLeft].tip + pose.leg[kRight].tip));
  };
  const double moving = feet_of(lunge).x() - hem_of(lunge).x();
  const double standing = feet_of(0.1).x() - hem_of(0.1).x();
  EXPECT_GT(moving, standing + 0.005);
}

TEST(Fight, stays_above_the_floor_and_inside_the_studio) {
  for (const Performer& performer : cast_of(2)) {
    for (double t = 0; t < kActionPeriodSeconds; t += 0.08) {
      for (const Part& part : performer_parts(t, 1, performer)) {
        for (const auto& v : part.mesh.vertices) {
          ASSERT_TRUE(v.z() >= -0.001F && v.z() <= 2.4F) << "at " << t;
          ASSERT_LT(v.head<2>().cwiseAbs().maxCoeff(), 1.5F) << "at " << t;
        }
      }
    }
  }
}

TEST(Fight, moves_without_jumps_also_at_the_end_of_the_period) {
  for (const Performer& performer : cast_of(2)) {
    for (int i = 0; i < 4000; ++i) {
      const double t = 1e-3 * i;
      const auto tip_at = [&](double s) { return sword_tip(pose_at(s, performer.motion)); };
      ASSERT_LT((tip_at(t + 1e-3) - tip_at(t)).norm(), 0.017) << "at " << t;
    }
  }
}

/// Voxels of 10 mm that contain a vertex of the performer.
std::set<std::array<int, 3>> cells_of(const Performer& performer, double seconds) {
  std::set<std::array<int, 3>> cells;
  for (const Part& part : performer_parts(seconds, 1, performer)) {
    for (const Eigen::Vector3f& v : part.mesh.vertices) {
      const Eigen::Vector3i cell = (100 * v.array()).floor().matrix().cast<int>();
      cells.insert({cell.x(), cell.y(), cell.z()});
    }
  }
  return cells;
}

TEST(Fight, has_contact_and_separates_again_at_least_twice_in_a_period) {
  const std::vector<Performer> cast = cast_of(2);
  int contacts = 0, pulses = 0;
  bool before = false;
  for (double t = 0; t < kActionPeriodSeconds; t += 0.04) {
    const auto first = cells_of(cast[0], t), second = cells_of(cast[1], t);
    const bool now = std::ranges::any_of(second, [&](const auto& c) { return first.contains(c); });
    contacts += now && !before;
    pulses += now;
    before = now;
  }
  EXPECT_GE(contacts, 2);
  EXPECT_GT(pulses, 15);
  EXPECT_LT(pulses, 60);
}

TEST(Fight, is_between_performers_in_different_colours) {
  const std::vector<Performer> cast = cast_of(2);
  const Mesh first = outer_surface(performer_parts(0, 1, cast[0]), 1);
  const Mesh second = outer_surface(performer_parts(0, 1, cast[1]), 1);
  const auto mean_blue = [](const Mesh& mesh) {
    double sum = 0;
    for (const Rgb8& colour : mesh.colours) sum += colour.b;
    return sum / static_cast<double>(mesh.colours.size());
  };
  EXPECT_GT(mean_blue(first), mean_blue(second) + 20);
}

TEST(Paint, has_fine_detail_on_every_material) {
  for (const Palette palette : {Palette::kIndigo, Palette::kPlum}) {
    for (int m = 0; m <= static_cast<int>(Material::kGuard); ++m) {
      float low = 2, high = -1;
      for (int i = 0; i < 200; ++i) {
        // A patch of 2 cm, on the front of a part of 7 cm radius.
        const Eigen::Vector3f position(0.07F, 0.0001F * static_cast<float>(i % 14 * 14),
                                       0.0001F * static_cast<float>(i));
        const float value = paint(static_cast<Material>(m), position, 1, palette).sum();
        low = std::min(low, value);
        high = std::max(high, value);
      }
      EXPECT_GT(high - low, 0.02F) << "material " << m;
    }
  }
}

}  // namespace
}  // namespace v3d::sim
