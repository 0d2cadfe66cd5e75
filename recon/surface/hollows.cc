#include "recon/surface/hollows.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <numeric>

#include "base/statistics.h"
#include "recon/hull/marching_cubes.h"
#include "recon/hull/volume_cut.h"
#include "recon/mesh/neighbours.h"
#include "recon/mesh/smooth_surface.h"
#include "recon/mesh/vertex_loop.h"
#include "recon/surface/cover.h"
#include "recon/surface/label_field.h"
#include "recon/surface/onlookers.h"
#include "recon/surface/sight_votes.h"
#include "recon/surface/stillness.h"

namespace v3d {
namespace {

using Eigen::Vector3f;

// Where the surface is looked for; lengths in voxels. A label of LabelField is a depth.
constexpr int kLooks = 3;          ///< each from the surface that those before have opened
constexpr size_t kEvery = 4;       ///< only so many-th vertex looks, about two voxels apart
constexpr size_t kEveryLater = 6;  ///< in the looks after the first
constexpr float kStep = 0.8F;      ///< between depths
constexpr float kSpacing = 2;      ///< between the samples of a template window
constexpr int kSide = 5;           ///< of the window, samples
constexpr int kLevel = 1;          ///< of the pictures: half resolution
constexpr int kMostViews = HollowSights::kMostCameras;  ///< that look at a place
constexpr float kHiddenBehind = 0.6F;
constexpr float kNoiseVariance = 2;  ///< squared grey values
constexpr int kSmoothing = 2, kNormalSmoothing = 4;

/// Correlation by which a depth must be better than one a step less deep: what lies deep competes
/// with many. That is where the best of the near depths stands out of the far ones, nearly all of
/// which are wrong, by kContrast in the median, as with cameras that are calibrated well. Where it
/// stands out less, wrong depths win more often, and the price grows with the cube.
constexpr float kPriceOfStep = 1.0F / 64;
constexpr float kContrast = 0.31F;
constexpr float kMostShortfall = 2;
constexpr size_t kEveryContrast = 8;  ///< of those who look tells it
static_assert(BlockSight::kMost % kEveryContrast == 0, "the same ones by block");
constexpr float kUnit = 124;  ///< of LabelField's costs, for a correlation of 1
constexpr uint8_t kSlope = 31;
constexpr int kRounds = 4;

/// Correlation with another camera from which on a camera is said to see the place.
constexpr float kAgreeing = 0.4F;
// Voxels along a ray from the place: the first that is seen through, and the last where the ray
// leaves the hull on a slant. The votes count one voxel around.
constexpr float kFirstFree = 3.5F;
constexpr float kMostSlant = 3, kBeyondSkin = 2;
constexpr int kSolid = 5;  ///< voxels from the place inwards

constexpr int kLeastVotes = 16;  ///< of vertices
constexpr int kCutSmoothing = 8;
constexpr int kCrumb = 2000;  ///< voxels

constexpr int kLabels = LabelField::kLabels;
static_assert(kLabels == 2 * kDepthSteps);

CorrelationOptions depths_from(int first) {
  return {.side = kSide, .first = static_cast<float>(first), .noise = kNoiseVariance};
}
const CorrelationOptions kNear = depths_from(1 - kDepthSteps), kFar = depths_from(1 - kLabels);

void keep(const CorrelationOptions& options, WindowViews& views) {
  int kept = 0;
  for (int c = 0; c < views.count; ++c) {
    if (!window_fits(views.view[c], options)) continue;
    views.view[kept] = views.view[c];
    views.camera[kept++] = views.camera[c];
  }
  views.count = kept;
}

}  // namespace

class HollowCarver::Impl {
 public:
  HollowSights look(const SurfaceCameras& cameras, const Mesh& hull, const SparseVolume& volume) {
    HollowSights found;
    voxel_ = static_cast<float>(volume.grid().voxel_m);
    if (cameras.cameras.size() < 2 || hull.vertices.empty()) return found;
    look(cameras, hull, kEvery, [](const Vector3f&) { return true; });
    found.covered.resize(cameras.cameras.size());
    tbb::parallel_for(size_t{0}, found.covered.size(), [&](size_t c) {
      found.covered[c] = covered(cameras.cameras[c], depths_[c]);
    });
    price_of_step_ = find_price_of_step();
    agree(found.sights);

    // What that opens shows the cameras more.
    SightVotes votes(volume);
    std::vector<Brick> opened(volume.bricks().size(), kEmptyBrick);
    for (size_t voted = 0, looks = 1; looks < kLooks; ++looks) {
      vote(cameras, std::span(found.sights).subspan(voted), votes);
      voted = found.sights.size();
      const VolumeCut cut = cut_of(volume, votes);
      const std::vector<uint8_t> near = cut.bricks_near_more_than(opened);
      if (std::find(near.begin(), near.end(), 1) == near.end()) break;
      opened = cut.bricks();
      marching_cubes_.run(cut.remaining(), left_);
      look(cameras, left_, kEveryLater, [&](const Vector3f& place) {
        const int brick = votes.brick_at(place);
        return brick >= 0 && near[brick] != 0;
      });
      agree(found.sights);
    }
    return found;
  }

  SparseVolume carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                     const HollowSights& sights, std::span<const SightsBeside> beside) {
    voxel_ = static_cast<float>(volume.grid().voxel_m);
    if (sights.sights.empty()) return volume;
    SightVotes votes(volume);
    vote(cameras, sights.sights, votes);
    for (const SightsBeside& other : beside) vote(other, votes);
    VolumeCut cut = cut_of(volume, votes);
    cut.add_crumbs(kCrumb);
    cut.keep(needed_voxels(cameras, volume, cut, sights.covered));
    return cut.remaining();
  }

 private:
  static constexpr uint32_t kNobody = UINT32_MAX;

  /// What a vertex sees; the arrays are by label.
  struct Sight {
    uint32_t vertex = 0;
    WindowViews views = {};
    std::array<float, kLabels> score{};       ///< see PairAgreement; 0 where nobody looked
    std::array<uint8_t, kLabels> agreeing{};  ///< likewise

    bool sees() const { return views.count >= 2; }
    /// By how much the best near depth stands out of the far ones.
    float contrast() const {
      const auto far = score.begin() + kDepthSteps;
      return *std::max_element(score.begin(), far) -
             std::accumulate(far, score.end(), 0.0F) / (kLabels - kDepthSteps);
    }
  };

  void prepare(const SurfaceCameras& cameras, const Mesh& surface) {
    mesh_ = surface;
    neighbours_ = Neighbours(mesh_);
    smooth_surface(neighbours_, kSmoothing, mesh_.vertices, work_);
    tbb::parallel_invoke(
        [&] {
          normals_ = vertex_normals(mesh_);
          smooth_normals(neighbours_, kNormalSmoothing, normals_, work_);
        },
        [&] { draw_depths(mesh_, cameras.models, depths_, Faces::kFront); });
  }

  /// From every so many-th vertex of the surface for which where(place).
  template <class Where>
  void look(const SurfaceCameras& cameras, const Mesh& surface, size_t every, const Where& where) {
    prepare(cameras, surface);
    every_ = every;
    sights_.clear();
    node_of_.assign(mesh_.vertices.size(), kNobody);
    for (size_t v = 0; v < mesh_.vertices.size(); v += every) {
      if (!where(mesh_.vertices[v])) continue;
      node_of_[v] = static_cast<uint32_t>(sights_.size());
      sights_.push_back({.vertex = static_cast<uint32_t>(v)});
    }
    tbb::enumerable_thread_specific<Onlookers> of_threads;
    for_each_block<BlockSight::kMost>(sights_.size(), [&](size_t begin, size_t end) {
      look_at_block(cameras.cameras, std::span(sights_).subspan(begin, end - begin),
                    of_threads.local());
    });
  }

  void look_at_block(std::span<const SurfaceCamera> cameras, std::span<Sight> sights,
                     Onlookers& onlookers) {
    const size_t count = sights.size();
    std::array<Vector3f, BlockSight::kMost> places, normals;
    for (size_t i = 0; i < count; ++i) {
      places[i] = mesh_.vertices[sights[i].vertex];
      normals[i] = normals_[sights[i].vertex];
    }
    const auto where = std::span(places).first(count), facing = std::span(normals).first(count);
    onlookers.look(where, facing, cameras, depths_, {.tolerance_m = kHiddenBehind * voxel_});
    onlookers.windows.find(where, facing, cameras, onlookers.sights(),
                           {.level = kLevel,
                            .most_views = kMostViews,
                            .spacing_m = kSpacing * voxel_,
                            .step_m = kStep * voxel_},
                           kFar);
    for (size_t i = 0; i < count; ++i) {
      compare(onlookers.windows.views(i), sights[i], i % kEveryContrast == 0);
    }
  }

  /// `all`: of the far depths, too, whatever the near ones are like.
  static void compare(const WindowViews& views, Sight& sight, bool all) {
    sight.views = views;
    keep(kNear, sight.views);
    if (!sight.sees()) return;
    compare(kNear, 0, sight);
    if (all || may_be_far(sight)) compare(kFar, kDepthSteps, sight);
  }

  /// Half of the labels, from `first` on, which is the last depth of the profile.
  static void compare(const CorrelationOptions& depths, int first, Sight& sight) {
    PairAgreement half;
    correlate_pairs(sight.views, depths, kAgreeing, half);
    for (int k = 0; k < kDepthSteps; ++k) {
      sight.score[first + k] = half.score[kDepthSteps - 1 - k];
      sight.agreeing[first + k] = half.agreeing[kDepthSteps - 1 - k];
    }
  }

  /// Whether a far depth that agreed perfectly would cost less than all near ones. Mostly not, and
  /// then nobody looks there.
  static bool may_be_far(const Sight& sight) {
    for (int label = 0; label < kDepthSteps; ++label) {
      const auto steps = static_cast<float>(kDepthSteps - label);
      if (1 - sight.score[label] < kPriceOfStep * steps) return false;
    }
    return true;
  }

  float find_price_of_step() {
    const float contrast = median_contrast();
    const float short_of = std::min(kMostShortfall, kContrast / std::max(contrast, 1e-3F));
    return kPriceOfStep * std::max(1.0F, short_of * short_of * short_of);
  }

  /// What labels cost.
  void price() {
    costs_.resize(sights_.size());
    for_each_vertex(sights_.size(), [&](size_t i) {
      for (int label = 0; label < kLabels; ++label) {
        const float disagreement = sights_[i].sees() ? 1 - sights_[i].score[label] : 0;
        const float cost = kUnit * (disagreement + price_of_step_ * static_cast<float>(label));
        costs_[i].of[label] =
            static_cast<int16_t>(std::min(cost + 0.5F, float{LabelField::kMostCost}));
      }
    });
  }

  float median_contrast() {
    contrasts_.clear();
    for (size_t i = 0; i < sights_.size(); i += kEveryContrast) {
      if (sights_[i].sees()) contrasts_.push_back(sights_[i].contrast());
    }
    return upper_median(contrasts_);
  }

  /// Those who look are neighbours when they are two edges apart at most.
  void connect() {
    constexpr size_t kBlock = 1024;
    std::vector<std::vector<LabelField::Edge>> of_blocks(sights_.size() / kBlock + 1);
    for_each_block<kBlock>(sights_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) connect(i, of_blocks[begin / kBlock]);
    });
    edges_.clear();
    for (const auto& edges : of_blocks) edges_.insert(edges_.end(), edges.begin(), edges.end());
  }

  /// Appends the edges to later ones.
  void connect(size_t i, std::vector<LabelField::Edge>& edges) const {
    const auto first = std::ssize(edges);
    const auto add = [&](uint32_t vertex) {
      const uint32_t node = node_of_[vertex];
      if (node == kNobody || node <= i) return;
      const LabelField::Edge edge(i, node);
      if (std::find(edges.begin() + first, edges.end(), edge) == edges.end()) {
        edges.push_back(edge);
      }
    };
    for (const uint32_t n : neighbours_.of(sights_[i].vertex)) {
      add(n);
      for (const uint32_t m : neighbours_.of(n)) add(m);
    }
  }

  /// Those who look agree about depths; appends what they saw.
  void agree(std::vector<HollowSights::Sight>& found) {
    price();
    connect();
    const std::span<const uint8_t> labels =
        labels_.solve(costs_, edges_, {.slope = kSlope, .rounds = kRounds});
    for (size_t i = 0; i < labels.size(); ++i) {
      if (sights_[i].agreeing[labels[i]] != 0) found.push_back(sight_of(sights_[i], labels[i]));
    }
  }

  HollowSights::Sight sight_of(const Sight& sight, int label) const {
    HollowSights::Sight seen;
    seen.vertices = static_cast<uint8_t>(every_);
    seen.depth_m = kStep * static_cast<float>(label) * voxel_;
    seen.outwards = normals_[sight.vertex];
    seen.place = mesh_.vertices[sight.vertex] - seen.depth_m * seen.outwards;
    for (int c = 0; c < sight.views.count; ++c) {
      if ((sight.agreeing[label] >> c & 1) == 0) continue;
      seen.cameras[seen.count++] = static_cast<uint16_t>(sight.views.camera[c]);
    }
    return seen;
  }

  void vote(const SurfaceCameras& cameras, std::span<const HollowSights::Sight> sights,
            SightVotes& votes) const {
    for_each_vertex(sights.size(), [&](size_t i) {
      vote(
          sights[i], [&](uint16_t camera) { return &cameras.cameras[camera]; }, votes);
    });
  }

  void vote(const SightsBeside& beside, SightVotes& votes) const {
    const std::vector<HollowSights::Sight>& sights = beside.sights->sights;
    for_each_vertex(sights.size(), [&](size_t i) {
      const auto still = [&](uint16_t camera) -> const SurfaceCamera* {
        const auto& [then, now] = beside.cameras[camera];
        const auto seen = now != nullptr ? now->project(sights[i].place) : std::nullopt;
        return seen && stillness(*now, *then, seen->pixel) > 0 ? now : nullptr;
      };
      vote(sights[i], still, votes);
    });
  }

  /// camera_of(number): null for one that does not count.
  template <class CameraOf>
  void vote(const HollowSights::Sight& sight, const CameraOf& camera_of, SightVotes& votes) const {
    const float last = kMostSlant * sight.depth_m / voxel_ + kBeyondSkin;
    int cameras = 0;
    for (int c = 0; c < sight.count; ++c) {
      const SurfaceCamera* camera = camera_of(sight.cameras[c]);
      if (camera == nullptr) continue;
      ++cameras;
      const Vector3f out = (camera->center() - sight.place).normalized();
      for (float way = kFirstFree; way < last; ++way) {
        votes.seen_through(sight.place + way * voxel_ * out, sight.vertices);
      }
    }
    for (int way = 0; cameras >= 2 && way < kSolid; ++way) {
      votes.seen_there(sight.place - static_cast<float>(way) * voxel_ * sight.outwards,
                       sight.vertices);
    }
  }

  static VolumeCut cut_of(const SparseVolume& volume, const SightVotes& votes) {
    VolumeCut cut(volume, votes.seen_through(kLeastVotes));
    cut.smooth(kCutSmoothing);
    return cut;
  }

  /// Those of the cut without which cameras would look through the hull where they see something: a
  /// blade that was taken for air.
  std::vector<Brick> needed_voxels(const SurfaceCameras& cameras, const SparseVolume& volume,
                                   const VolumeCut& cut, std::span<const Mask> before) {
    marching_cubes_.run(cut.remaining(), left_);
    draw_depths(left_, cameras.models, depths_, Faces::kFront);
    std::vector<Mask> open(cameras.cameras.size());
    tbb::parallel_for(size_t{0}, open.size(),
                      [&](size_t c) { open[c] = uncovered(before[c], depths_[c]); });
    return voxels_at(open, cameras.cameras, volume, cut.bricks());
  }

  float voxel_ = 0;
  Mesh mesh_;
  Neighbours neighbours_;
  std::vector<DepthBuffer> depths_;
  std::vector<Vector3f> normals_, work_;
  size_t every_ = kEvery;          ///< vertex looked last
  std::vector<Sight> sights_;      ///< of those who look: the nodes of labels_
  std::vector<uint32_t> node_of_;  ///< by vertex
  float price_of_step_ = 0;
  std::vector<float> contrasts_;
  std::vector<LabelField::Costs> costs_;
  std::vector<LabelField::Edge> edges_;
  LabelField labels_;
  MarchingCubes marching_cubes_;
  Mesh left_;  ///< surface of what the cut leaves
};

HollowCarver::HollowCarver() : impl_(std::make_unique<Impl>()) {}
HollowCarver::~HollowCarver() = default;
HollowSights HollowCarver::look(const SurfaceCameras& cameras, const Mesh& hull,
                                const SparseVolume& volume) {
  return impl_->look(cameras, hull, volume);
}
SparseVolume HollowCarver::carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                                 const HollowSights& sights, std::span<const SightsBeside> beside) {
  return impl_->carve(cameras, volume, sights, beside);
}

}  // namespace v3d
