#include "recon/frame_quality.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "base/mask_shape.h"
#include "recon/box_view.h"
#include "recon/screen_vertex.h"

namespace v3d {
namespace {

constexpr int kCellShift = 3;
constexpr int kCell = 1 << kCellShift;

/// Cells of an image with a ring of one round it, so that neighbours need no care.
struct Cells {
  explicit Cells(ImageSize size)
      : columns((size.width + kCell - 1) / kCell),
        rows((size.height + kCell - 1) / kCell),
        values(static_cast<size_t>(columns + 2) * (rows + 2)) {}
  uint8_t& at(int column, int row) {
    return values[static_cast<size_t>(row + 1) * (columns + 2) + column + 1];
  }

  int columns, rows;
  std::vector<uint8_t> values;
};

/// Vertices no farther apart than this, pixels, leave no cell within the surface empty.
constexpr float kDense = 0.75F * kCell;
/// Vertices lie in runs along the axes, those of the three axes between each other: with every
/// second one, gaps are two edges long at most.
constexpr size_t kStride = 2;

int cell_of(float pixels) {
  constexpr float kFar = 1 << 20;  // whole cells, so that what lies before the image rounds alike
  return (static_cast<int>(std::clamp(pixels, -kFar, kFar) + (kFar + 0.5F)) - (1 << 20)) >>
         kCellShift;
}

/// Marks the cells of the vertices; the width in pixels of `edge_m` where the nearest one is.
float reach_vertices(const std::vector<ScreenVertex>& vertices, float edge_px_m, Cells& reached) {
  float nearest = 0;
  for (const ScreenVertex& vertex : vertices) {
    if (!vertex.on_screen()) continue;
    const int column = cell_of(vertex.x);
    const int row = cell_of(vertex.y);
    if (column < 0 || row < 0 || column >= reached.columns || row >= reached.rows) continue;
    reached.at(column, row) = 1;
    nearest = std::max(nearest, vertex.inverse_z);
  }
  return nearest * edge_px_m;
}

/// Marks the cells that triangles touch with their bounding boxes.
void reach_triangles(const Mesh& mesh, const std::vector<ScreenVertex>& vertices, Cells& reached) {
  for (const auto& [i, j, k] : mesh.triangles) {
    const ScreenVertex &a = vertices[i], &b = vertices[j], &c = vertices[k];
    if (!a.on_screen() || !b.on_screen() || !c.on_screen()) continue;
    const auto [left, right] = std::minmax({a.x, b.x, c.x});
    const auto [top, bottom] = std::minmax({a.y, b.y, c.y});
    const int last_column = std::min(cell_of(right), reached.columns - 1);
    const int last_row = std::min(cell_of(bottom), reached.rows - 1);
    for (int y = std::max(cell_of(top), 0); y <= last_row; ++y) {
      for (int x = std::max(cell_of(left), 0); x <= last_column; ++x) reached.at(x, y) = 1;
    }
  }
}

/// `sparse`: every kStride-th vertex, which is enough for a camera that is not too near.
Cells reached_cells(const Mesh& mesh, const Mesh& sparse, const CameraModel& camera,
                    double edge_m) {
  Cells reached(camera.size());
  const auto edge_px_m = static_cast<float>(camera.matrix()(0, 0) * edge_m);
  const float edge = reach_vertices(project_vertices(sparse, camera), edge_px_m, reached);
  if (kStride * edge <= kCell) return reached;
  const std::vector<ScreenVertex> vertices = project_vertices(mesh, camera);
  if (reach_vertices(vertices, edge_px_m, reached) > kDense) {
    reach_triangles(mesh, vertices, reached);
  }
  return reached;
}

/// Pixels of the mask in every cell.
Cells pixels_in_cells(const Mask& mask) {
  constexpr int kCellsOfWord = 64 / kCell;
  Cells cells(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    const auto row = mask.row(y);
    for (size_t w = 0; w < row.size(); ++w) {
      for (uint64_t rest = row[w]; rest != 0;) {
        const int n = std::countr_zero(rest) >> kCellShift;
        const uint64_t cell = uint64_t{0xFF} << (n << kCellShift);
        cells.at(static_cast<int>(w) * kCellsOfWord + n, y >> kCellShift) +=
            static_cast<uint8_t>(std::popcount(rest & cell));
        rest &= ~cell;
      }
    }
  }
  return cells;
}

bool is_near_any(Cells& cells, int column, int row) {
  for (int y = row - 1; y <= row + 1; ++y) {
    for (int x = column - 1; x <= column + 1; ++x) {
      if (cells.at(x, y) != 0) return true;
    }
  }
  return false;
}

}  // namespace

QualityMeter::QualityMeter(const Rig& rig, const Box& bounds, double edge_m)
    : models_(models_of(rig)), edge_m_(edge_m), views_(rig.size()) {
  tbb::parallel_for(size_t{0}, views_.size(),
                    [&](size_t c) { views_[c] = view_of(bounds, models_[c]); });
}

QualityMeter::Count QualityMeter::count(const Mesh& mesh, const Mesh& sparse,
                                        const Mask& silhouette, size_t camera) const {
  Cells pixels = pixels_in_cells(both(silhouette, views_[camera]));
  Cells reached = reached_cells(mesh, sparse, models_[camera], edge_m_);
  Count count;
  for (int y = 0; y < reached.rows; ++y) {
    for (int x = 0; x < reached.columns; ++x) {
      count.pixels += pixels.at(x, y);
      if (reached.at(x, y) == 0) continue;
      count.explained += pixels.at(x, y);
      if (!is_near_any(pixels, x, y)) count.too_much += kCell * kCell;
    }
  }
  return count;
}

FrameQuality QualityMeter::measure(const Mesh& mesh, std::span<const Frame* const> frames) const {
  Mesh sparse;
  for (size_t v = 0; v < mesh.vertices.size(); v += kStride) {
    sparse.vertices.push_back(mesh.vertices[v]);
  }
  std::vector<Count> counts(frames.size());
  tbb::parallel_for(size_t{0}, frames.size(), [&](size_t c) {
    if (frames[c] != nullptr) counts[c] = count(mesh, sparse, *frames[c]->mask, c);
  });
  FrameQuality quality;
  quality.cameras = static_cast<int>(
      std::ranges::count_if(frames, [](const Frame* frame) { return frame != nullptr; }));
  double sum = 0;
  int seeing = 0;
  Count all;
  for (const Count& count : counts) {
    all.pixels += count.pixels;
    all.explained += count.explained;
    const int64_t joined = count.pixels + count.too_much;
    if (joined == 0) continue;
    sum += static_cast<double>(count.explained) / static_cast<double>(joined);
    ++seeing;
  }
  if (seeing > 0) quality.silhouette_iou = sum / seeing;
  if (all.pixels > 0) {
    quality.coverage = static_cast<double>(all.explained) / static_cast<double>(all.pixels);
  }
  return quality;
}

}  // namespace v3d
