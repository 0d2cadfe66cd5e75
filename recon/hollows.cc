#include "recon/hollows.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>

#include "recon/cover.h"
#include "recon/label_field.h"
#include "recon/marching_cubes.h"
#include "recon/neighbours.h"
#include "recon/onlookers.h"
#include "recon/sight_votes.h"
#include "recon/smooth_surface.h"
#include "recon/vertex_loop.h"
#include "recon/volume_cut.h"

namespace v3d {
namespace {

using Eigen::Vector3f;

// Where the surface is looked for; lengths in voxels. A label of LabelField is a depth.
constexpr size_t kEvery = 4;   ///< only so many-th vertex looks, about two voxels apart
constexpr float kStep = 0.8F;  ///< between depths
constexpr float kSpacing = 2;  ///< between the samples of a template window
constexpr int kSide = 5;       ///< of the window, samples
constexpr int kLevel = 1;      ///< of the pictures: half resolution
constexpr int kMostViews = 6;  ///< cameras that look at a place
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
constexpr float kUnit = 512;  ///< of LabelField's costs, for a correlation of 1
constexpr int16_t kSlope = 128;
constexpr int kRounds = 6;

/// Correlation with another camera from which on a camera is said to see the place.
constexpr float kAgreeing = 0.4F;
// Voxels along a ray from the place: the first that is seen through, and the last where the ray
// leaves the hull on a slant. The votes count one voxel around.
constexpr float kFirstFree = 3.5F;
constexpr float kMostSlant = 3, kBeyondSkin = 2;
constexpr int kSolid = 3;  ///< voxels from the place inwards

constexpr int kLeastVotes = 4;
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
  SparseVolume carve(const SurfaceCameras& cameras, const Mesh& hull, const SparseVolume& volume) {
    voxel_ = static_cast<float>(volume.grid().voxel_m);
    cameras_ = cameras.cameras;
    if (cameras_.size() < 2 || hull.vertices.empty()) return volume;
    prepare(hull, cameras.models);
    look();
    price();
    connect();
    SightVotes votes(volume);
    vote(labels_.solve(costs_, edges_, {.slope = kSlope, .rounds = kRounds}), votes);
    VolumeCut cut(volume, votes.seen_through(kLeastVotes));
    cut.smooth(kCutSmoothing);
    cut.add_crumbs(kCrumb);
    cut.keep(needed_voxels(volume, cut, cameras.models));
    return cut.remaining();
  }

 private:
  /// What a vertex sees; the arrays are by label.
  struct Sight {
    WindowViews views;
    std::array<float, kLabels> score{};       ///< see PairAgreement
    std::array<uint8_t, kLabels> agreeing{};  ///< likewise

    bool sees() const { return views.count >= 2; }
    /// By how much the best near depth stands out of the far ones.
    float contrast() const {
      const auto far = score.begin() + kDepthSteps;
      return *std::max_element(score.begin(), far) -
             std::accumulate(far, score.end(), 0.0F) / (kLabels - kDepthSteps);
    }
  };

  void prepare(const Mesh& hull, std::span<const CameraModel> models) {
    mesh_ = hull;
    neighbours_ = Neighbours(mesh_);
    smooth_surface(neighbours_, kSmoothing, mesh_.vertices, work_);
    normals_ = vertex_normals(mesh_);
    smooth_normals(neighbours_, kNormalSmoothing, normals_, work_);
    draw_depths(mesh_, models, depths_, Faces::kFront);
  }

  void look() {
    sights_.resize((mesh_.vertices.size() + kEvery - 1) / kEvery);
    tbb::enumerable_thread_specific<Onlookers> of_threads;
    for_each_block<BlockSight::kMost>(sights_.size(), [&](size_t begin, size_t end) {
      look_at_block(begin, end, of_threads.local());
    });
  }

  void look_at_block(size_t first, size_t end, Onlookers& onlookers) {
    const size_t count = end - first;
    std::array<Vector3f, BlockSight::kMost> places, normals;
    for (size_t i = 0; i < count; ++i) {
      places[i] = mesh_.vertices[kEvery * (first + i)];
      normals[i] = normals_[kEvery * (first + i)];
    }
    const auto where = std::span(places).first(count), facing = std::span(normals).first(count);
    onlookers.look(where, facing, cameras_, depths_, {.tolerance_m = kHiddenBehind * voxel_});
    onlookers.windows.find(where, facing, cameras_, onlookers.sights(),
                           {.level = kLevel,
                            .most_views = kMostViews,
                            .spacing_m = kSpacing * voxel_,
                            .step_m = kStep * voxel_},
                           kFar);
    for (size_t i = 0; i < count; ++i) compare(onlookers.windows.views(i), sights_[first + i]);
  }

  static void compare(const WindowViews& views, Sight& sight) {
    sight = {.views = views};
    keep(kNear, sight.views);
    if (!sight.sees()) return;
    PairAgreement near, far;
    correlate_pairs(sight.views, kNear, kAgreeing, near);
    correlate_pairs(sight.views, kFar, kAgreeing, far);
    for (int label = 0; label < kLabels; ++label) {
      // Label 0 is the last depth of the near profile.
      const PairAgreement& half = label < kDepthSteps ? near : far;
      const int k = kDepthSteps - 1 - label % kDepthSteps;
      sight.score[label] = half.score[k];
      sight.agreeing[label] = half.agreeing[k];
    }
  }

  /// What labels cost.
  void price() {
    const float contrast = median_contrast();
    const float short_of = std::min(kMostShortfall, kContrast / std::max(contrast, 1e-3F));
    const float step = kPriceOfStep * std::max(1.0F, short_of * short_of * short_of);
    costs_.resize(sights_.size());
    for_each_vertex(sights_.size(), [&](size_t i) {
      for (int label = 0; label < kLabels; ++label) {
        const float disagreement = sights_[i].sees() ? 1 - sights_[i].score[label] : 0;
        const float cost = kUnit * (disagreement + step * static_cast<float>(label));
        costs_[i].of[label] =
            static_cast<int16_t>(std::min(cost + 0.5F, float{LabelField::kMostCost}));
      }
    });
  }

  float median_contrast() {
    contrasts_.clear();
    for (const Sight& sight : sights_) {
      if (sight.sees()) contrasts_.push_back(sight.contrast());
    }
    if (contrasts_.empty()) return 0;
    const auto middle = contrasts_.begin() + std::ssize(contrasts_) / 2;
    std::nth_element(contrasts_.begin(), middle, contrasts_.end());
    return *middle;
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
      if (vertex % kEvery != 0 || vertex / kEvery <= i) return;
      const LabelField::Edge edge(i, vertex / kEvery);
      if (std::find(edges.begin() + first, edges.end(), edge) == edges.end()) {
        edges.push_back(edge);
      }
    };
    for (const uint32_t n : neighbours_.of(i * kEvery)) {
      add(n);
      for (const uint32_t m : neighbours_.of(n)) add(m);
    }
  }

  void vote(std::span<const uint8_t> labels, SightVotes& votes) const {
    for_each_vertex(labels.size(), [&](size_t i) {
      const Sight& sight = sights_[i];
      if (!sight.sees()) return;
      const int label = labels[i];
      const size_t v = i * kEvery;
      const float depth = kStep * static_cast<float>(label);
      const Vector3f place = mesh_.vertices[v] - depth * voxel_ * normals_[v];
      const uint32_t agreeing = sight.agreeing[label];
      for (int c = 0; c < sight.views.count; ++c) {
        if ((agreeing >> c & 1) == 0) continue;
        const Vector3f out = (cameras_[sight.views.camera[c]].center() - place).normalized();
        for (float way = kFirstFree; way < kMostSlant * depth + kBeyondSkin; ++way) {
          votes.seen_through(place + way * voxel_ * out);
        }
      }
      for (int way = 0; agreeing != 0 && way < kSolid; ++way) {
        votes.seen_there(place - static_cast<float>(way) * voxel_ * normals_[v]);
      }
    });
  }

  /// Those of the cut without which cameras would look through the hull where they see something: a
  /// blade that was taken for air.
  std::vector<Brick> needed_voxels(const SparseVolume& volume, const VolumeCut& cut,
                                   std::span<const CameraModel> models) {
    marching_cubes_.run(cut.remaining(), left_);
    draw_depths(left_, models, left_depths_, Faces::kFront);
    std::vector<Mask> open(cameras_.size());
    tbb::parallel_for(size_t{0}, open.size(), [&](size_t c) {
      open[c] = uncovered(cameras_[c], depths_[c], left_depths_[c]);
    });
    return voxels_at(open, cameras_, volume, cut.bricks());
  }

  float voxel_ = 0;
  Mesh mesh_;
  Neighbours neighbours_;
  std::span<const SurfaceCamera> cameras_;  ///< of the frame at work
  std::vector<DepthBuffer> depths_;
  std::vector<Vector3f> normals_, work_;
  std::vector<Sight> sights_;
  std::vector<float> contrasts_;
  std::vector<LabelField::Costs> costs_;
  std::vector<LabelField::Edge> edges_;
  LabelField labels_;
  MarchingCubes marching_cubes_;
  Mesh left_;  ///< surface of what the cut leaves
  std::vector<DepthBuffer> left_depths_;
};

HollowCarver::HollowCarver() : impl_(std::make_unique<Impl>()) {}
HollowCarver::~HollowCarver() = default;
SparseVolume HollowCarver::carve(const SurfaceCameras& cameras, const Mesh& hull,
                                 const SparseVolume& volume) {
  return impl_->carve(cameras, hull, volume);
}

}  // namespace v3d
