#include "recon/motion/surface_patches.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/surface/template_windows.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix2f;
using Eigen::Matrix3f;
using Eigen::Vector2f;
using Eigen::Vector3f;

/// Metres between two samples: fine, coarse. A pixel has about 4.5 mm on the performer.
constexpr std::array kStepM{0.004F, 0.007F};
/// Cosines between the normal and the direction to a camera.
constexpr float kMinLearntFacing = 0.6F, kMinFacing = 0.35F;
constexpr float kToleranceM = 0.012F;  ///< of the visibility test
/// Cosine of the axes of two patches that are neighbours.
constexpr float kMinParallel = 0.8F;
constexpr float kMinContrast = 2.5F;  ///< grey values; less is noise
constexpr float kMinCorrelation = 0.7F;
constexpr float kMinCoarseCorrelation = 0.5F;
/// Samples on each side of the middle of a patch, and with the border for gradients.
constexpr int kReach = SurfacePatches::kSide / 2, kLearntReach = kReach + 1;
constexpr int kAlignments = 6;
constexpr float kAlignedSteps = 0.01F;  ///< the alignment ends with a change below it
constexpr float kMinCurvature = 0.05F;
constexpr float kMaxAlignedSteps = 2;
/// Grey values: noise of a difference of two images and errors of the model.
constexpr float kNoise = 4;
/// Standard deviation of a match at which its precision is 1/2, metres.
constexpr float kUsefulM = 0.0015F;

}  // namespace

/// One patch in one camera: its centre in a picture, and one step along each axis.
struct SurfacePatches::PatchView {
  const Luminance* picture = nullptr;
  Vector2f centre{0, 0}, across{0, 0}, down{0, 0};

  float sample(float i, float j) const {
    const Vector2f at = centre + i * across + j * down;
    const float x = std::clamp(at.x(), 0.0F, static_cast<float>(picture->width()) - 1.001F);
    const float y = std::clamp(at.y(), 0.0F, static_cast<float>(picture->height()) - 1.001F);
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
    const uint32_t quad =
        picture->quads()[static_cast<size_t>(row) * static_cast<size_t>(picture->width()) +
                         static_cast<size_t>(column)];
    const auto corner = [&](int n) { return static_cast<float>(quad >> (8 * n) & 255); };
    const float top = corner(0) + fx * (corner(1) - corner(0));
    const float bottom = corner(2) + fx * (corner(3) - corner(2));
    return top + fy * (bottom - top);
  }
};

namespace {

using PatchView = SurfacePatches::PatchView;

/// Empty where a corner of the patch lies outside the silhouette.
std::optional<PatchView> view_of(const SurfaceCamera& camera, const Vector3f& position,
                                 const Vector3f& across, const Vector3f& down, size_t level) {
  const float step = kStepM[level];
  const auto middle = camera.project(position);
  const auto aside = camera.project(position + step * across);
  const auto below = camera.project(position + step * down);
  if (!middle || !aside || !below) return std::nullopt;
  const Vector2f across_px = aside->pixel - middle->pixel, down_px = below->pixel - middle->pixel;
  constexpr auto kHalf = static_cast<float>(kReach);
  const float half = kHalf * kStepM[0] / step;  // the fine patch must lie inside
  for (const float sign : {-1.0F, 1.0F}) {
    if (!camera.in_silhouette(middle->pixel + sign * half * (across_px + down_px)) ||
        !camera.in_silhouette(middle->pixel + sign * half * (across_px - down_px))) {
      return std::nullopt;
    }
  }
  const Luminance& picture = camera.picture(static_cast<int>(level));
  const float scale = picture.scale();
  const Vector2f first(picture.first_u(), picture.first_v());
  return PatchView{&picture, scale * middle->pixel - first, scale * across_px, scale * down_px};
}

/// Index of a sample of a square patch, row by row.
size_t index_of(int row, int column, int edge) {
  return static_cast<size_t>(row) * static_cast<size_t>(edge) + static_cast<size_t>(column);
}

template <size_t kCount>
float normalise(std::array<float, kCount>& samples) {
  float mean = 0;
  for (const float s : samples) mean += s;
  mean /= static_cast<float>(kCount);
  float sum = 0;
  for (float& s : samples) {
    s -= mean;
    sum += s * s;
  }
  const float deviation = std::sqrt(sum / static_cast<float>(kCount));
  const float scale = 1 / std::max(deviation, 1e-3F);
  for (float& s : samples) s *= scale;
  return deviation;
}

}  // namespace

SurfacePatches::SurfacePatches(const Mesh& rest, double spacing_m) {
  const std::vector<Vector3f> normals = vertex_normals(rest);
  const DeformationGraph spaced(rest, spacing_m);
  std::vector<uint32_t> number(spaced.nodes(), kNoPatch);  // of the patch at each node
  for (size_t node = 0; node < spaced.nodes(); ++node) {
    const uint32_t vertex = spaced.vertices_of_nodes()[node];
    const Vector3f& normal = normals[vertex];
    if (normal.squaredNorm() < 0.5F) continue;
    const Vector3f other = std::abs(normal.z()) < 0.9F ? Vector3f::UnitZ() : Vector3f::UnitX();
    Patch patch;
    patch.vertex = vertex;
    patch.across = normal.cross(other).normalized();
    patch.down = normal.cross(patch.across);
    number[node] = static_cast<uint32_t>(patches_.size());
    patches_.push_back(patch);
  }
  for (const DeformationGraph::Edge& edge : spaced.edges()) {
    const uint32_t a = number[edge.a], b = number[edge.b];
    if (a == kNoPatch || b == kNoPatch) continue;
    if (patches_[a].across.dot(patches_[b].across) < kMinParallel ||
        patches_[a].down.dot(patches_[b].down) < kMinParallel) {
      continue;
    }
    neighbours_.push_back({a, b});
  }
  for (const DeformationGraph::Influence& influence : spaced.influences()) {
    const bool has_node = influence.weight[0] > 0;
    const uint32_t patch = has_node ? number[influence.node[0]] : kNoPatch;
    nearest_.push_back(patch == kNoPatch ? kNoPatch : patches_[patch].vertex);
  }
}

std::vector<Matrix3f> SurfacePatches::rotations(const DeformationGraph& graph,
                                                std::span<const NodeMotion> motion) const {
  std::vector<Matrix3f> result(patches_.size());
  for_each_vertex(patches_.size(), [&](size_t i) {
    result[i] = graph.rotation_at(motion, patches_[i].vertex).cast<float>();
  });
  return result;
}

/// The cameras that see each patch, most frontal first.
void SurfacePatches::find_views(const SeenSurface& seen, float min_facing,
                                std::vector<Views>& views) const {
  views.assign(patches_.size(), {});
  const std::vector<SurfaceCamera>& cameras = seen.cameras->cameras;
  for_each_block<VertexVisibility::kCapacity>(patches_.size(), [&](size_t begin, size_t end) {
    std::array<Vector3f, VertexVisibility::kCapacity> positions, normals;
    for (size_t i = begin; i < end; ++i) {
      positions[i - begin] = seen.surface->vertices[patches_[i].vertex];
      normals[i - begin] = (*seen.normals)[patches_[i].vertex];
    }
    BlockVisibility block;
    block.compute(std::span(positions).first(end - begin), std::span(normals).first(end - begin),
                  cameras, seen.depths, {.min_facing = min_facing, .tolerance_m = kToleranceM});
    for (size_t i = begin; i < end; ++i) {
      Views& of_patch = views[i];
      for (uint32_t c = 0; c < cameras.size(); ++c) {
        const View view{c, block.by_camera()[c].seen[i - begin]};
        if (view.facing < min_facing) continue;
        const auto at = std::find_if(of_patch.list.begin(), of_patch.list.begin() + of_patch.count,
                                     [&](const View& v) { return v.facing < view.facing; });
        if (at == of_patch.list.end()) continue;
        std::move_backward(at, of_patch.list.end() - 1, of_patch.list.end());
        *at = view;
        of_patch.count = std::min(of_patch.count + 1, static_cast<int>(of_patch.list.size()));
      }
    }
  });
}

bool SurfacePatches::learn_patch(const SurfaceCamera& camera, const Vector3f& position,
                                 const Matrix3f& rotation, Patch& patch) {
  std::array<Appearance, kLevels> learnt;
  for (size_t level = 0; level < kLevels; ++level) {
    const auto view =
        view_of(camera, position, rotation * patch.across, rotation * patch.down, level);
    if (!view) return false;
    Samples<kLearntSide> wide;
    for (int row = 0; row < kLearntSide; ++row) {
      for (int column = 0; column < kLearntSide; ++column) {
        wide[index_of(row, column, kLearntSide)] = view->sample(
            static_cast<float>(column - kLearntReach), static_cast<float>(row - kLearntReach));
      }
    }
    Appearance& seen = learnt[level];
    const auto at = [&](int column, int row) {
      return wide[index_of(row + 1, column + 1, kLearntSide)];
    };
    for (int row = 0; row < kSide; ++row) {
      for (int column = 0; column < kSide; ++column) {
        const size_t n = index_of(row, column, kSide);
        seen.samples[n] = at(column, row);
        seen.across[n] = 0.5F * (at(column + 1, row) - at(column - 1, row));
        seen.down[n] = 0.5F * (at(column, row + 1) - at(column, row - 1));
      }
    }
    seen.contrast = normalise(seen.samples);
    if (seen.contrast < kMinContrast) return false;
    seen.curvature.setZero();
    for (size_t n = 0; n < seen.samples.size(); ++n) {
      seen.across[n] /= seen.contrast;
      seen.down[n] /= seen.contrast;
      const Vector2f gradient(seen.across[n], seen.down[n]);
      seen.curvature += gradient * gradient.transpose();
    }
  }
  patch.levels = learnt;
  return true;
}

void SurfacePatches::learn(const SeenSurface& seen, std::span<const Matrix3f> rotations) {
  std::vector<Views> views;
  find_views(seen, kMinLearntFacing, views);
  for_each_vertex(patches_.size(), [&](size_t i) {
    Patch& patch = patches_[i];
    if (patch.facing > 0 || views[i].count == 0) return;
    const View& best = views[i].list[0];
    if (learn_patch(seen.cameras->cameras[best.camera], seen.surface->vertices[patch.vertex],
                    rotations[i], patch)) {
      patch.facing = best.facing;
    }
  });
}

namespace {

constexpr int kWide = SurfacePatches::kSide + 2 * ShiftCorrelations::kMaxReach;

/// Adds the correlations of a patch, as it was learnt, with all shifts of a view.
void add_correlations(const PatchView& view, std::span<const float> samples, int reach,
                      std::span<float> sums) {
  constexpr int kSide = SurfacePatches::kSide;
  constexpr float kCount = kSide * kSide;
  const int wide = kSide + 2 * reach, edge = 2 * reach + 1, half = wide / 2;
  std::array<float, static_cast<size_t>(kWide) * kWide> now;
  // Sums of samples and of their squares over the rectangle before each sample.
  std::array<float, static_cast<size_t>(kWide + 1) * (kWide + 1)> sum{}, squares{};
  const auto corner = [&](int x, int y) { return index_of(y, x, kWide + 1); };
  for (int y = 0; y < wide; ++y) {
    float line = 0, line_squares = 0;
    for (int x = 0; x < wide; ++x) {
      const float value =
          view.sample(static_cast<float>(x - half), static_cast<float>(y - half)) - 128;
      now[index_of(y, x, wide)] = value;
      line += value;
      line_squares += value * value;
      sum[corner(x + 1, y + 1)] = sum[corner(x + 1, y)] + line;
      squares[corner(x + 1, y + 1)] = squares[corner(x + 1, y)] + line_squares;
    }
  }
  const auto box = [&](const auto& sums_before, int x, int y) {
    return sums_before[corner(x + kSide, y + kSide)] - sums_before[corner(x, y + kSide)] -
           sums_before[corner(x + kSide, y)] + sums_before[corner(x, y)];
  };
  for (int y = 0; y < edge; ++y) {
    for (int x = 0; x < edge; ++x) {
      float product = 0;
      for (int row = 0; row < kSide; ++row) {
        const float* line = &now[index_of(row + y, x, wide)];
        const float* wanted = &samples[index_of(row, 0, kSide)];
        for (int column = 0; column < kSide; ++column) product += line[column] * wanted[column];
      }
      const float mean = box(sum, x, y) / kCount;
      const float variance = box(squares, x, y) / kCount - mean * mean;
      sums[index_of(y, x, edge)] += product / (kCount * std::sqrt(std::max(variance, 1.0F)));
    }
  }
}

}  // namespace

/// The views of a patch at a position, for a level of the pictures.
std::vector<PatchView> SurfacePatches::views_of(const SeenSurface& seen, const Views& views,
                                                const Placed& at, size_t level) {
  std::vector<PatchView> list;
  for (int k = 0; k < views.count; ++k) {
    const SurfaceCamera& camera = seen.cameras->cameras[views.list[static_cast<size_t>(k)].camera];
    if (const auto view = view_of(camera, at.position, at.across, at.down, level)) {
      list.push_back(*view);
    }
  }
  return list;
}

std::vector<std::optional<PatchShift>> SurfacePatches::search(const SeenSurface& seen,
                                                              std::span<const Views> views,
                                                              std::span<const Placed> placed,
                                                              int reach) const {
  ShiftCorrelations correlations(patches_.size(), reach);
  for_each_block<64>(patches_.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (patches_[i].facing == 0) continue;
      const std::vector<PatchView> coarse = views_of(seen, views[i], placed[i], 1);
      if (coarse.empty()) continue;
      const std::span<float> sums = correlations.of(i);
      for (const PatchView& view : coarse) {
        add_correlations(view, patches_[i].levels[1].samples, reach, sums);
      }
      for (float& value : sums) value /= static_cast<float>(coarse.size());
      correlations.set_known(i);
    }
  });
  return likely_shifts(correlations, neighbours_);
}

/// Aligns a patch by Gauss-Newton steps. The cameras share the shift; each has its own mean and
/// contrast.
std::optional<PatchMatch> SurfacePatches::align(const Patch& patch, const Placed& at,
                                                std::span<const PatchView> views) {
  if (views.empty()) return std::nullopt;
  const Appearance& wanted = patch.levels[0];
  const Matrix2f inverse =
      (static_cast<float>(views.size()) * (wanted.curvature + kMinCurvature * Matrix2f::Identity()))
          .inverse();
  Vector2f steps(0, 0);
  float correlation = 0;
  for (int k = 0; k < kAlignments; ++k) {
    Vector2f gradient(0, 0);
    correlation = 0;
    for (const PatchView& view : views) {
      Samples<kSide> now;
      for (int row = 0; row < kSide; ++row) {
        for (int column = 0; column < kSide; ++column) {
          now[index_of(row, column, kSide)] =
              view.sample(static_cast<float>(column - kReach) + steps.x(),
                          static_cast<float>(row - kReach) + steps.y());
        }
      }
      normalise(now);
      for (size_t n = 0; n < now.size(); ++n) {
        const float difference = now[n] - wanted.samples[n];
        gradient += difference * Vector2f(wanted.across[n], wanted.down[n]);
        correlation += now[n] * wanted.samples[n];
      }
    }
    correlation /= static_cast<float>(views.size() * wanted.samples.size());
    const Vector2f change = inverse * gradient;
    steps -= change;
    if (change.squaredNorm() < kAlignedSteps * kAlignedSteps) break;
  }
  if (!(steps.norm() < kMaxAlignedSteps) || correlation < kMinCorrelation) return std::nullopt;

  PatchMatch match;
  match.vertex = patch.vertex;
  match.position = at.position + kStepM[0] * (steps.x() * at.across + steps.y() * at.down);
  match.correlation = correlation;
  // Variance along an axis: noise^2 / (contrast^2 * curvature).
  const Eigen::SelfAdjointEigenSolver<Matrix2f> axes(wanted.curvature);
  const float noise = kNoise * kStepM[0] / wanted.contrast;
  for (int k = 0; k < 2; ++k) {
    const Vector2f axis = axes.eigenvectors().col(k);
    match.directions[static_cast<size_t>(k)] = axis.x() * at.across + axis.y() * at.down;
    const float variance = noise * noise / std::max(axes.eigenvalues()[k], 1e-6F);
    match.precision[static_cast<size_t>(k)] =
        kUsefulM * kUsefulM / (kUsefulM * kUsefulM + variance);
  }
  return match;
}

PatchMatches SurfacePatches::match(const SeenSurface& seen, std::span<const Matrix3f> rotations,
                                   float reach_m) const {
  std::vector<Views> views;
  find_views(seen, kMinFacing, views);
  std::vector<Placed> placed(patches_.size());
  for (size_t i = 0; i < patches_.size(); ++i) {
    const Patch& patch = patches_[i];
    placed[i] = {seen.surface->vertices[patch.vertex], rotations[i] * patch.across,
                 rotations[i] * patch.down};
  }
  const int reach = static_cast<int>(std::ceil(reach_m / kStepM[1]));
  std::vector<std::optional<PatchShift>> shifts(patches_.size(), PatchShift{0, 0, 1});
  if (reach_m > kStepM[0]) {
    shifts = search(seen, views, placed, std::min(reach, ShiftCorrelations::kMaxReach));
  }
  std::vector<std::optional<PatchMatch>> found(patches_.size());
  std::vector<uint8_t> is_missing(patches_.size(), 0);
  for_each_block<64>(patches_.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (patches_[i].facing == 0) continue;
      Placed start = placed[i];
      const bool has_shift = shifts[i] && shifts[i]->correlation >= kMinCoarseCorrelation;
      if (has_shift) {
        start.position += kStepM[1] * (static_cast<float>(shifts[i]->across) * start.across +
                                       static_cast<float>(shifts[i]->down) * start.down);
      }
      const std::vector<PatchView> shown = views_of(seen, views[i], start, 0);
      if (has_shift) found[i] = align(patches_[i], start, shown);
      is_missing[i] = !found[i] && !shown.empty() ? 1 : 0;
    }
  });
  PatchMatches matches;
  for (size_t i = 0; i < found.size(); ++i) {
    if (found[i]) matches.found.push_back(*found[i]);
    if (is_missing[i] != 0) matches.missing.push_back(patches_[i].vertex);
  }
  return matches;
}

}  // namespace v3d::recon
