#include "recon/surface/concavity_carving.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <random>

#include "base/image/mask_operations.h"
#include "recon/hull/intersect.h"
#include "recon/hull/sparse_volume.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{320, 240};
constexpr double kVoxelM = 0.010;
/// Between the two arms of the scene, in front of its body.
constexpr float kInside = 0.09F, kBelly = 0.02F, kArms = 0.16F, kTop = 0.15F;

/// A box with meshed sides, whose vertices can be speckled.
Mesh fine_box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  constexpr int kParts = 40;
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool far : {false, true}) {
      Mesh side = shapes::patch(1, 0, kParts);
      for (Eigen::Vector3f& v : side.vertices) {
        Eigen::Vector3f at;
        at[axis] = far ? 1.0F : -1.0F;
        at[(axis + 1) % 3] = far ? v.x() : -v.x();
        at[(axis + 2) % 3] = v.y();
        v = (0.5F * (low + high).array() + 0.5F * (high - low).array() * at.array()).matrix();
      }
      shapes::append(mesh, side);
    }
  }
  return mesh;
}

/// A body with arms in front of it: no silhouette of a camera beside it shows the belly.
Mesh embrace() {
  const float z = 1;
  Mesh mesh = fine_box({-kArms, -kArms, z - kTop}, {kBelly, kArms, z + kTop});
  shapes::append(mesh, fine_box({kBelly, -kArms, z - kTop}, {kArms, -kInside, z + kTop}));
  shapes::append(mesh, fine_box({kBelly, kInside, z - kTop}, {kArms, kArms, z + kTop}));
  return mesh;
}

bool in_concavity(const Eigen::Vector3d& p) {
  return p.x() > kBelly && p.x() < kArms && std::abs(p.y()) < kInside && std::abs(p.z() - 1) < kTop;
}

Mesh speckled(Mesh mesh, unsigned seed = 5) {
  std::mt19937 random(seed);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto grey = static_cast<uint8_t>(40 + random() % 200);
    mesh.colours.push_back({grey, grey, grey});
  }
  return mesh;
}

Mesh plain(Mesh mesh) {
  mesh.colours.assign(mesh.vertices.size(), {120, 120, 120});
  return mesh;
}

SparseVolume carved_by(ConcavityCarver& carver, const SurfaceCameras& cameras, const Mesh& hull,
                       const SparseVolume& volume) {
  return carver.carve(cameras, volume, carver.find_samples(cameras, hull, volume), {});
}

struct Studio {
  std::vector<CameraModel> models;
  std::vector<Frame> frames;
  std::vector<DeformCamera> cameras;
  SparseVolume volume;
  Mesh hull;

  explicit Studio(const Mesh& scene) : Studio(scene, scene) {}
  /// `seen`: the scene of the images, if it differs from that of the silhouettes.
  Studio(const Mesh& scene, const Mesh& seen) {
    for (int i = 0; i < 14; ++i) {
      // All around, and a few closer together in front of the concavity.
      const double angle = i < 8 ? 2 * std::numbers::pi * (i + 0.5) / 8 : 0.14 * (i - 10.5);
      models.push_back(
          shapes::camera({2 * std::cos(angle), 2 * std::sin(angle), 1 + 0.12 * (i % 3 - 1)},
                         {0, 0, 1}, kSize, 700, {-0.1, 0.02}));
    }
    const std::vector<Mask> masks = draw_silhouettes(scene, models);
    std::vector<const Mask*> borrowed;
    for (size_t i = 0; i < models.size(); ++i) {
      frames.push_back(
          observe("cam" + std::to_string(i), {}, draw_mesh(seen, models[i]).view(), masks[i]));
      borrowed.push_back(&masks[i]);
    }
    for (size_t i = 0; i < models.size(); ++i) cameras.push_back({&models[i], &frames[i]});
    const VoxelGrid grid = VoxelGrid::covering({{-0.3, -0.3, 0.7}, {0.3, 0.3, 1.3}}, kVoxelM);
    volume = Intersector(grid, models, 3).intersect(borrowed);
    hull = marching_cubes(volume);
  }

  SparseVolume carved() const {
    ConcavityCarver carver;
    return carved_by(carver, before(hull), hull, volume);
  }

  /// The first `count` cameras before a mesh.
  SurfaceCameras before(const Mesh& mesh, size_t count = 14) const {
    return {std::span(cameras).first(count), mesh, kVoxelM};
  }
};

const Studio& studio() {
  static const Studio kStudio(speckled(embrace()));
  return kStudio;
}

bool in_body(const Eigen::Vector3d& p) {
  const bool arm = std::abs(p.y()) > kInside && p.x() < kArms;
  return (p.x() < kBelly || arm) && p.x() > -kArms && std::abs(p.y()) < kArms &&
         std::abs(p.z() - 1) < kTop;
}

/// Occupied voxels in the concavity, and in body and arms.
struct Count {
  int concavity = 0, solid = 0;
};

Count count(const SparseVolume& volume) {
  Count counts;
  const auto& n = volume.grid().counts;
  for (int k = 0; k < n[2]; ++k) {
    for (int j = 0; j < n[1]; ++j) {
      for (int i = 0; i < n[0]; ++i) {
        if (!volume.get(i, j, k)) continue;
        const Eigen::Vector3d at = volume.grid().center(i, j, k);
        counts.concavity += in_concavity(at);
        counts.solid += in_body(at);
      }
    }
  }
  return counts;
}

TEST(ConcavityCarver, empties_visible_concavities_and_keeps_solid_parts) {
  const Count hull = count(studio().volume), carved = count(studio().carved());
  EXPECT_GT(hull.concavity, 4'500) << "the silhouettes span it";
  // One pass leaves 0.54 of the excess, and two leave 0.40. The three voxels before a found surface
  // get no votes, and cameras see into the depth only through voxels that earlier passes removed.
  EXPECT_LT(carved.concavity, 0.32 * hull.concavity);
  EXPECT_GT(carved.solid, 0.98 * hull.solid);
}

/// Upright before the arms.
Mesh blade() { return shapes::box({0.24F, -0.02F, 0.9F}, {0.26F, 0.02F, 1.1F}); }

/// Foreground pixels of all cameras that the hull covers and that are more than two pixels outside
/// the projection of `left`.
int64_t opened_pixels(const Studio& studio, const SparseVolume& left) {
  const std::vector<Mask> before = draw_silhouettes(studio.hull, studio.models);
  const std::vector<Mask> after = draw_silhouettes(marching_cubes(left), studio.models);
  int64_t opened = 0;
  for (size_t c = 0; c < before.size(); ++c) {
    const Mask seen = intersection_of(before[c], *studio.frames[c].mask);
    opened += difference_of(seen, dilate(after[c], 2)).count();
  }
  return opened;
}

TEST(ConcavityCarver, keeps_all_silhouettes_covered) {
  Mesh with_blade = embrace();
  shapes::append(with_blade, blade());
  // The images show the background at the blade, as for a mirroring blade.
  const Studio there(with_blade, speckled(embrace()));
  const SparseVolume left = there.carved();
  EXPECT_LT(count(left).concavity, 0.8 * count(there.volume).concavity);
  EXPECT_EQ(opened_pixels(there, left), 0);
  const SparseVolume without_blade = make_volume(left.grid(), [&](int i, int j, int k) {
    return left.get(i, j, k) && left.grid().center(i, j, k).x() < 0.22;
  });
  EXPECT_GT(opened_pixels(there, without_blade), 500) << "where the blade is missing it shows";
}

/// The remaining volume when little is visible now, but much was at the previous pulse.
SparseVolume carved_by_the_pulse_before(const Studio& then, size_t cameras_now = 14) {
  const Studio& now = studio();
  const SurfaceCameras seeing = now.before(now.hull), seen = then.before(then.hull);
  ConcavityCarver carver;
  StereoSamples little = carver.find_samples(seeing, now.hull, now.volume);
  little.samples.resize(1);
  const StereoSamples much = carver.find_samples(seen, then.hull, then.volume);
  NeighbourSamples before{&much, {}};
  for (size_t c = 0; c < seen.cameras.size(); ++c) {
    before.cameras.push_back({&seen.cameras[c], c < cameras_now ? &seeing.cameras[c] : nullptr});
  }
  EXPECT_EQ(carver.carve(seeing, now.volume, little, {}), now.volume);
  return carver.carve(seeing, now.volume, little, {&before, 1});
}

TEST(ConcavityCarver, reuses_the_previous_pulse_where_images_show_no_motion) {
  EXPECT_LT(count(carved_by_the_pulse_before(studio())).concavity,
            0.32 * count(studio().volume).concavity);
  EXPECT_EQ(carved_by_the_pulse_before(Studio(speckled(embrace(), 8))), studio().volume);
  EXPECT_EQ(carved_by_the_pulse_before(studio(), 0), studio().volume) << "cameras that are gone";
}

TEST(ConcavityCarver, removes_nothing_without_comparable_images) {
  const Studio blank(plain(embrace()));
  EXPECT_EQ(blank.carved(), blank.volume);
}

TEST(ConcavityCarver, requires_two_cameras) {
  ConcavityCarver carver;
  const auto some = [&](size_t cameras) {
    return carved_by(carver, studio().before(studio().hull, cameras), studio().hull,
                     studio().volume);
  };
  EXPECT_EQ(some(0), studio().volume);
  EXPECT_EQ(some(1), studio().volume);
  const SparseVolume nothing(studio().volume.grid());
  EXPECT_EQ(carved_by(carver, studio().before({}), Mesh{}, nothing), nothing);
}

TEST(ConcavityCarver, returns_the_same_volume_for_any_number_of_threads) {
  const auto with_threads = [](int threads) {
    return tbb::task_arena(threads).execute([] { return studio().carved(); });
  };
  const SparseVolume expected = with_threads(1);
  EXPECT_EQ(with_threads(2), expected);
  EXPECT_EQ(with_threads(5), expected);
}

TEST(ConcavityCarver, is_independent_of_the_previous_frame) {
  ConcavityCarver carver;
  const SparseVolume box = make_volume(studio().volume.grid(), [](int i, int j, int k) {
    return i > 20 && i < 40 && j > 20 && j < 40 && k > 20 && k < 40;
  });
  carved_by(carver, studio().before(marching_cubes(box)), marching_cubes(box), box);
  EXPECT_EQ(carved_by(carver, studio().before(studio().hull), studio().hull, studio().volume),
            studio().carved());
}

}  // namespace
}  // namespace v3d::recon
