#include "recon/metrics/frame_quality.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

#include "recon/hull/voxel_grid.h"
#include "recon/render/rasteriser.h"
#include "recon/visibility/point_depth_buffer.h"

namespace v3d::recon {
namespace {

constexpr int kCellShift = 3;
constexpr int kCell = 1 << kCellShift;
constexpr int kCellsOfWord = 64 / kCell;

/// Counts by cell of an image. A ring of one cell around the image avoids special cases for
/// neighbours. Rows have room for whole words of a mask row.
struct Cells {
  explicit Cells(ImageSize size)
      : columns((size.width + kCell - 1) / kCell),
        rows((size.height + kCell - 1) / kCell),
        pitch((size.width + 63) / 64 * kCellsOfWord + 2),
        values(static_cast<size_t>(pitch) * (rows + 2) + 1) {}
  uint8_t& at(int column, int row) {
    return values[static_cast<size_t>(row + 1) * pitch + column + 1];
  }
  /// For locate_points(): indices into `values`; points that are not seen have the last one. Points
  /// nearer than `whole_from_z`, metres, have no index.
  CellGrid grid(float whole_from_z) const {
    constexpr float kRing = -kCell;
    return {kRing, kRing, 1.0F / kCell, pitch, rows + 2, whole_from_z};
  }

  int columns, rows;
  int pitch;  ///< from row to row
  std::vector<uint8_t> values;
};

/// Points at most this far apart, pixels, leave no cell inside the surface empty.
constexpr double kSparse = kCell;
constexpr double kDense = 0.75 * kCell;
/// Vertices are ordered in runs along the axes, and the runs of the three axes alternate. So gaps
/// between every second vertex are at most two edges long.
constexpr size_t kStride = 2;

std::vector<Eigen::Vector3f> every_second(const std::vector<Eigen::Vector3f>& vertices,
                                          size_t first) {
  std::vector<Eigen::Vector3f> half;
  half.reserve(vertices.size() / kStride + 1);
  for (size_t v = first; v < vertices.size(); v += kStride) half.push_back(vertices[v]);
  return half;
}

int cell_of(float pixels) {
  // A whole number of cells, so that negative coordinates round down too.
  constexpr float kFar = 1 << 20;
  return (static_cast<int>(std::clamp(pixels, -kFar, kFar) + (kFar + 0.5F)) - (1 << 20)) >>
         kCellShift;
}

/// Marks the cells that the bounding boxes of triangles touch.
void reach_triangles(const Mesh& mesh, const CameraModel& camera, Cells& reached) {
  const std::vector<ScreenVertex> vertices = project_vertices(mesh, camera);
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

/// Marks the cells of the points. Returns false when a point is nearer than `whole_from_z`, metres.
bool reach_points(const PointArrays& points, const VoxelCamera& lens, double whole_from_z,
                  Cells& reached) {
  const CellGrid grid = reached.grid(static_cast<float>(whole_from_z));
  LocatedPoints located;
  bool all = true;
  for (size_t block = 0; block < points.blocks(); ++block) {
    locate_points(lens, grid, points, block * PointArrays::kBlock, located);
    for (const int32_t cell : located.cell) {
      if (cell == LocatedPoints::kNear) {
        all = false;
      } else {
        reached.values[cell] = 1;
      }
    }
  }
  return all;
}

/// The cells that the surface reaches. Half of the vertices are sufficient unless the camera is
/// near.
Cells reached_cells(const Mesh& mesh, std::span<const PointArrays, 2> halves,
                    const CameraModel& camera, double edge_m) {
  Cells reached(camera.size());
  const VoxelCamera lens = camera_of_metres(camera);
  // Length of an edge in pixels, at a distance of 1 m.
  const double edge_px_m = camera.matrix()(0, 0) * edge_m;
  if (reach_points(halves[0], lens, kStride * edge_px_m / kSparse, reached)) return reached;
  const double dense_from_z = edge_px_m / kDense;
  const bool first = reach_points(halves[0], lens, dense_from_z, reached);
  const bool second = reach_points(halves[1], lens, dense_from_z, reached);
  if (!first || !second) reach_triangles(mesh, camera, reached);
  return reached;
}

/// The number of set bits of each byte.
uint64_t bits_of_bytes(uint64_t word) {
  word -= (word >> 1) & 0x5555'5555'5555'5555;
  word = (word & 0x3333'3333'3333'3333) + ((word >> 2) & 0x3333'3333'3333'3333);
  return (word + (word >> 4)) & 0x0F0F'0F0F'0F0F'0F0F;
}

/// Number of pixels in both masks, by cell. A cell has at most 64 pixels, so the sums of eight
/// cells in a word never carry into each other.
Cells pixels_in_cells(const Mask& mask, const Mask& within) {
  Cells cells(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    const auto row = mask.row(y), inner = within.row(y);
    for (size_t w = 0; w < row.size(); ++w) {
      const uint64_t word = row[w] & inner[w];
      if (word == 0) continue;
      uint8_t* counts = &cells.at(static_cast<int>(w) * kCellsOfWord, y >> kCellShift);
      uint64_t sums = 0;
      std::memcpy(&sums, counts, sizeof sums);
      sums += bits_of_bytes(word);
      std::memcpy(counts, &sums, sizeof sums);
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
                    [&](size_t c) { views_[c] = bounds_mask(bounds, models_[c]); });
}

QualityMeter::Count QualityMeter::count(const Mesh& mesh, std::span<const PointArrays, 2> halves,
                                        const Mask& silhouette, size_t camera) const {
  Cells pixels = pixels_in_cells(silhouette, views_[camera]);
  Cells reached = reached_cells(mesh, halves, models_[camera], edge_m_);
  Count count;
  for (int y = 0; y < reached.rows; ++y) {
    for (int x = 0; x < reached.columns; ++x) {
      count.pixels += pixels.at(x, y);
      if (reached.at(x, y) == 0) continue;
      count.explained += pixels.at(x, y);
      if (!is_near_any(pixels, x, y)) count.excess += kCell * kCell;
    }
  }
  return count;
}

FrameQuality QualityMeter::measure(const Mesh& mesh, std::span<const Frame* const> frames) const {
  const std::array halves{PointArrays(every_second(mesh.vertices, 0)),
                          PointArrays(every_second(mesh.vertices, 1))};
  std::vector<Count> counts(frames.size());
  tbb::parallel_for(size_t{0}, frames.size(), [&](size_t c) {
    if (frames[c] != nullptr) counts[c] = count(mesh, halves, *frames[c]->mask, c);
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
    const int64_t joined = count.pixels + count.excess;
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

}  // namespace v3d::recon
