#include "recon/surface/concavity_carving.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <numeric>

#include "base/core/statistics.h"
#include "recon/hull/sparse_volume.h"
#include "recon/hull/volume_components.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/surface/belief_propagation.h"
#include "recon/surface/template_windows.h"
#include "recon/surface/temporal_smoothing.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

// Parameters of the depth search; lengths in voxels. A label of BeliefPropagation is a depth.
constexpr int kPasses = 3;    ///< each searches the surface that the earlier ones exposed
constexpr size_t kEvery = 4;  ///< every n-th vertex is searched, about two voxels apart
constexpr size_t kEveryInLaterPasses = 6;             ///< in the passes after the first
constexpr float kStep = 0.8F;                         ///< between depths
constexpr float kSpacing = 2;                         ///< between the samples of a template window
constexpr int kSide = 5;                              ///< of the window, samples
constexpr int kLevel = 1;                             ///< of the images: half resolution
constexpr int kMaxViews = StereoSample::kMaxCameras;  ///< cameras per vertex
constexpr float kHiddenBehind = 0.6F;
constexpr float kNoiseVariance = 2;  ///< squared grey values
constexpr int kSmoothing = 2, kNormalSmoothing = 4;

/// Correlation by which a depth must exceed one that is a step less deep, because many large depths
/// compete. With well calibrated cameras, the best near depth exceeds the mean of the far depths by
/// kContrast (median). Nearly all far depths are wrong. With less contrast, wrong depths win more
/// often, and the step cost increases with its cube.
constexpr float kStepCost = 1.0F / 64;
constexpr float kContrast = 0.31F;
constexpr float kMaxShortfall = 2;
constexpr size_t kEveryContrast = 8;  ///< every n-th search is used for the contrast
static_assert(VertexVisibility::kCapacity % kEveryContrast == 0, "blocks contain whole groups");
constexpr float kUnit = 124;  ///< cost of a correlation that is lower by 1
constexpr uint8_t kSlope = 31;
constexpr int kIterations = 4;

/// Smallest correlation with another camera for a camera to count as seeing the sample.
constexpr float kAgreeing = 0.4F;
// Votes for empty along a ray: distance of the first vote from the sample, voxels. The last vote is
// where an oblique ray leaves the hull. Votes are summed over neighbouring voxels.
constexpr float kFirstFree = 3.5F;
constexpr float kMaxSlant = 3, kBeyondSkin = 2;
constexpr int kVotesInwards = 5;  ///< votes for occupied, voxels from the sample inwards

constexpr int kMinVotes = 16;  ///< summed over vertices
constexpr int kCutSmoothing = 8;
constexpr int kFragmentVoxels = 2000;

constexpr int kLabels = BeliefPropagation::kLabels;
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

class ConcavityCarver::Impl {
 public:
  StereoSamples find_samples(const SurfaceCameras& cameras, const Mesh& hull,
                             const SparseVolume& volume) {
    StereoSamples found;
    voxel_ = static_cast<float>(volume.grid().voxel_m);
    if (cameras.cameras.size() < 2 || hull.vertices.empty()) return found;
    search_surface(cameras, hull, kEvery, [](const Vector3f&) { return true; });
    found.covered.resize(cameras.cameras.size());
    tbb::parallel_for(size_t{0}, found.covered.size(), [&](size_t c) {
      found.covered[c] = covered_pixels(cameras.cameras[c], depths_[c]);
    });
    step_cost_ = find_step_cost();
    select_depths(found.samples);

    // On the surface that the votes expose, the cameras see more of the body.
    FreeSpaceVotes votes(volume);
    std::vector<codec::Brick> opened(volume.bricks().size(), codec::kEmptyBrick);
    for (size_t voted = 0, pass = 1; pass < kPasses; ++pass) {
      vote(cameras, std::span(found.samples).subspan(voted), votes);
      voted = found.samples.size();
      const VolumeCut cut = cut_by(volume, votes);
      const std::vector<uint8_t> near = cut.bricks_near_more_than(opened);
      if (std::find(near.begin(), near.end(), 1) == near.end()) break;
      opened = cut.bricks();
      marching_cubes_.run(cut.remaining(), remaining_);
      search_surface(cameras, remaining_, kEveryInLaterPasses, [&](const Vector3f& position) {
        const int brick = votes.brick_at(position);
        return brick >= 0 && near[brick] != 0;
      });
      select_depths(found.samples);
    }
    return found;
  }

  SparseVolume carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                     const StereoSamples& samples, std::span<const NeighbourSamples> adjacent) {
    voxel_ = static_cast<float>(volume.grid().voxel_m);
    if (samples.samples.empty()) return volume;
    FreeSpaceVotes votes(volume);
    vote(cameras, samples.samples, votes);
    for (const NeighbourSamples& other : adjacent) vote(other, votes);
    VolumeCut cut = cut_by(volume, votes);
    cut.add_fragments(kFragmentVoxels);
    cut.keep(needed_voxels(cameras, volume, cut, samples.covered));
    return cut.remaining();
  }

 private:
  static constexpr uint32_t kNoNode = UINT32_MAX;

  /// Depth search of one vertex; arrays are indexed by label.
  struct VertexSearch {
    uint32_t vertex = 0;
    WindowViews views = {};
    std::array<float, kLabels> score{};       ///< see PairAgreement; 0 where not computed
    std::array<uint8_t, kLabels> agreeing{};  ///< see PairAgreement; 0 where not computed

    bool has_views() const { return views.count >= 2; }
    /// Best score of the near depths minus the mean of the far ones.
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

  /// Searches every `every`-th vertex for which where(position) is true.
  template <class Where>
  void search_surface(const SurfaceCameras& cameras, const Mesh& surface, size_t every,
                      const Where& where) {
    prepare(cameras, surface);
    every_ = every;
    searches_.clear();
    node_of_.assign(mesh_.vertices.size(), kNoNode);
    for (size_t v = 0; v < mesh_.vertices.size(); v += every) {
      if (!where(mesh_.vertices[v])) continue;
      node_of_[v] = static_cast<uint32_t>(searches_.size());
      searches_.push_back({.vertex = static_cast<uint32_t>(v)});
    }
    tbb::enumerable_thread_specific<BlockVisibility> of_threads;
    for_each_block<VertexVisibility::kCapacity>(searches_.size(), [&](size_t begin, size_t end) {
      search_block(cameras.cameras, std::span(searches_).subspan(begin, end - begin),
                   of_threads.local());
    });
  }

  void search_block(std::span<const SurfaceCamera> cameras, std::span<VertexSearch> searches,
                    BlockVisibility& block) {
    const size_t count = searches.size();
    std::array<Vector3f, VertexVisibility::kCapacity> positions, normals;
    for (size_t i = 0; i < count; ++i) {
      positions[i] = mesh_.vertices[searches[i].vertex];
      normals[i] = normals_[searches[i].vertex];
    }
    const auto where = std::span(positions).first(count), facing = std::span(normals).first(count);
    block.compute(where, facing, cameras, depths_, {.tolerance_m = kHiddenBehind * voxel_});
    block.windows.find(where, facing, cameras, block.by_camera(),
                       {.level = kLevel,
                        .max_views = kMaxViews,
                        .spacing_m = kSpacing * voxel_,
                        .step_m = kStep * voxel_},
                       kFar);
    for (size_t i = 0; i < count; ++i) {
      compare(block.windows.views(i), searches[i], i % kEveryContrast == 0);
    }
  }

  /// `all`: correlates the far depths even when a near depth is good enough.
  static void compare(const WindowViews& views, VertexSearch& search, bool all) {
    search.views = views;
    keep(kNear, search.views);
    if (!search.has_views()) return;
    compare(kNear, 0, search);
    if (all || needs_far_depths(search)) compare(kFar, kDepthSteps, search);
  }

  /// Scores of kDepthSteps labels from `first` on. Label `first` is the last depth of the profile.
  static void compare(const CorrelationOptions& depths, int first, VertexSearch& search) {
    PairAgreement half;
    correlate_pairs(search.views, depths, kAgreeing, half);
    for (int k = 0; k < kDepthSteps; ++k) {
      search.score[first + k] = half.score[kDepthSteps - 1 - k];
      search.agreeing[first + k] = half.agreeing[kDepthSteps - 1 - k];
    }
  }

  /// True when a far depth with perfect agreement would cost less than all near ones. This is rare,
  /// and far depths are correlated only then.
  static bool needs_far_depths(const VertexSearch& search) {
    for (int label = 0; label < kDepthSteps; ++label) {
      const auto steps = static_cast<float>(kDepthSteps - label);
      if (1 - search.score[label] < kStepCost * steps) return false;
    }
    return true;
  }

  float find_step_cost() {
    const float contrast = median_contrast();
    const float short_of = std::min(kMaxShortfall, kContrast / std::max(contrast, 1e-3F));
    return kStepCost * std::max(1.0F, short_of * short_of * short_of);
  }

  /// Costs of all labels for BeliefPropagation.
  void compute_costs() {
    costs_.resize(searches_.size());
    for_each_vertex(searches_.size(), [&](size_t i) {
      for (int label = 0; label < kLabels; ++label) {
        const float disagreement = searches_[i].has_views() ? 1 - searches_[i].score[label] : 0;
        const float cost = kUnit * (disagreement + step_cost_ * static_cast<float>(label));
        costs_[i].of[label] =
            static_cast<int16_t>(std::min(cost + 0.5F, float{BeliefPropagation::kMaxCost}));
      }
    });
  }

  float median_contrast() {
    contrasts_.clear();
    for (size_t i = 0; i < searches_.size(); i += kEveryContrast) {
      if (searches_[i].has_views()) contrasts_.push_back(searches_[i].contrast());
    }
    return upper_median(contrasts_);
  }

  /// Searched vertices are neighbours when they are at most two edges apart.
  void connect() {
    constexpr size_t kBlock = 1024;
    std::vector<std::vector<BeliefPropagation::Edge>> of_blocks(searches_.size() / kBlock + 1);
    for_each_block<kBlock>(searches_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) connect(i, of_blocks[begin / kBlock]);
    });
    edges_.clear();
    for (const auto& edges : of_blocks) edges_.insert(edges_.end(), edges.begin(), edges.end());
  }

  /// Appends the edges from node i to nodes with larger numbers.
  void connect(size_t i, std::vector<BeliefPropagation::Edge>& edges) const {
    const auto first = std::ssize(edges);
    const auto add = [&](uint32_t vertex) {
      const uint32_t node = node_of_[vertex];
      if (node == kNoNode || node <= i) return;
      const BeliefPropagation::Edge edge(i, node);
      if (std::find(edges.begin() + first, edges.end(), edge) == edges.end()) {
        edges.push_back(edge);
      }
    };
    for (const uint32_t n : neighbours_.of(searches_[i].vertex)) {
      add(n);
      for (const uint32_t m : neighbours_.of(n)) add(m);
    }
  }

  /// Selects a depth for each search by BeliefPropagation, and appends the samples on which cameras
  /// agree.
  void select_depths(std::vector<StereoSample>& found) {
    compute_costs();
    connect();
    const std::span<const uint8_t> labels =
        labels_.solve(costs_, edges_, {.slope = kSlope, .iterations = kIterations});
    for (size_t i = 0; i < labels.size(); ++i) {
      if (searches_[i].agreeing[labels[i]] != 0)
        found.push_back(sample_of(searches_[i], labels[i]));
    }
  }

  StereoSample sample_of(const VertexSearch& search, int label) const {
    StereoSample sample;
    sample.vertices = static_cast<uint8_t>(every_);
    sample.depth_m = kStep * static_cast<float>(label) * voxel_;
    sample.outwards = normals_[search.vertex];
    sample.position = mesh_.vertices[search.vertex] - sample.depth_m * sample.outwards;
    for (int c = 0; c < search.views.count; ++c) {
      if ((search.agreeing[label] >> c & 1) == 0) continue;
      sample.cameras[sample.count++] = static_cast<uint16_t>(search.views.camera[c]);
    }
    return sample;
  }

  void vote(const SurfaceCameras& cameras, std::span<const StereoSample> samples,
            FreeSpaceVotes& votes) const {
    for_each_vertex(samples.size(), [&](size_t i) {
      vote(
          samples[i], [&](uint16_t camera) { return &cameras.cameras[camera]; }, votes);
    });
  }

  void vote(const NeighbourSamples& adjacent, FreeSpaceVotes& votes) const {
    const std::vector<StereoSample>& samples = adjacent.samples->samples;
    for_each_vertex(samples.size(), [&](size_t i) {
      const auto still = [&](uint16_t camera) -> const SurfaceCamera* {
        const auto& [then, now] = adjacent.cameras[camera];
        const auto seen = now != nullptr ? now->project(samples[i].position) : std::nullopt;
        return seen && static_weight(*now, *then, seen->pixel) > 0 ? now : nullptr;
      };
      vote(samples[i], still, votes);
    });
  }

  /// camera_of(number) is null for a camera that is excluded.
  template <class CameraOf>
  void vote(const StereoSample& sample, const CameraOf& camera_of, FreeSpaceVotes& votes) const {
    const float last = kMaxSlant * sample.depth_m / voxel_ + kBeyondSkin;
    int cameras = 0;
    for (int c = 0; c < sample.count; ++c) {
      const SurfaceCamera* camera = camera_of(sample.cameras[c]);
      if (camera == nullptr) continue;
      ++cameras;
      const Vector3f out = (camera->center() - sample.position).normalized();
      for (float way = kFirstFree; way < last; ++way) {
        votes.vote_free(sample.position + way * voxel_ * out, sample.vertices);
      }
    }
    for (int way = 0; cameras >= 2 && way < kVotesInwards; ++way) {
      votes.vote_occupied(sample.position - static_cast<float>(way) * voxel_ * sample.outwards,
                          sample.vertices);
    }
  }

  static VolumeCut cut_by(const SparseVolume& volume, const FreeSpaceVotes& votes) {
    VolumeCut cut(volume, votes.free_voxels(kMinVotes));
    cut.smooth(kCutSmoothing);
    return cut;
  }

  /// Voxels of the cut that explain foreground of a camera, such as a blade that the votes declared
  /// empty.
  std::vector<codec::Brick> needed_voxels(const SurfaceCameras& cameras, const SparseVolume& volume,
                                          const VolumeCut& cut, std::span<const Mask> before) {
    marching_cubes_.run(cut.remaining(), remaining_);
    draw_depths(remaining_, cameras.models, depths_, Faces::kFront);
    std::vector<Mask> open(cameras.cameras.size());
    tbb::parallel_for(size_t{0}, open.size(),
                      [&](size_t c) { open[c] = uncovered_pixels(before[c], depths_[c]); });
    return voxels_at(open, cameras.cameras, volume, cut.bricks());
  }

  float voxel_ = 0;
  Mesh mesh_;
  Neighbours neighbours_;
  std::vector<DepthBuffer> depths_;
  std::vector<Vector3f> normals_, work_;
  size_t every_ = kEvery;               ///< of the last search
  std::vector<VertexSearch> searches_;  ///< nodes of labels_
  std::vector<uint32_t> node_of_;       ///< by vertex
  float step_cost_ = 0;
  std::vector<float> contrasts_;
  std::vector<BeliefPropagation::Costs> costs_;
  std::vector<BeliefPropagation::Edge> edges_;
  BeliefPropagation labels_;
  MarchingCubes marching_cubes_;
  Mesh remaining_;  ///< surface of the remaining volume
};

ConcavityCarver::ConcavityCarver() : impl_(std::make_unique<Impl>()) {}
ConcavityCarver::~ConcavityCarver() = default;
StereoSamples ConcavityCarver::find_samples(const SurfaceCameras& cameras, const Mesh& hull,
                                            const SparseVolume& volume) {
  return impl_->find_samples(cameras, hull, volume);
}
SparseVolume ConcavityCarver::carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                                    const StereoSamples& samples,
                                    std::span<const NeighbourSamples> adjacent) {
  return impl_->carve(cameras, volume, samples, adjacent);
}

}  // namespace v3d::recon
