#include "recon/visibility/depth_buffer.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/visibility/depth_buffer.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "recon/render/rasteriser.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_float.inc"

using LaneMask = hn::Mask<Floats>;
using IntLanes = hn::Vec<Ints>;

/// Number of triangles fetched at once. Written values are read again when they have left the store
/// buffer but are still in the first-level cache.
constexpr size_t kBlock = 128;

/// Limits of small triangles. Corners at max_of kMaxExtent pixels apart keep the integer products
/// below 31 bits. The pixel centres covered by the bounding box are at max_of kMaxBox along each
/// side; all are tested for all triangles of a register.
constexpr int kMaxExtent = 32;
constexpr int kMaxBox = 8;

/// Twice the smallest area, square pixels, for which a plane is defined. Smaller triangles have the
/// 1/z of their first corner.
constexpr float kMinArea = 1e-9F;

/// The corners of a block of triangles, one array per corner and coordinate. Each array has room
/// for one more register.
struct Corners {
  alignas(64) float x[3][kBlock + kLanes], y[3][kBlock + kLanes], inverse_z[3][kBlock + kLanes];
  size_t count = 0;
};

/// Buffered writes to the depth buffer: pixels and their values. The loop that fills it has no
/// branch that depends on a single triangle.
struct Samples {
  static constexpr size_t kCapacity = 1024;
  int32_t pixel[kCapacity + (kMaxBox * kMaxBox + 1) * kLanes];
  float value[kCapacity + (kMaxBox * kMaxBox + 1) * kLanes];
  size_t count = 0;

  void write_to(float* inverse_z) {
    for (size_t i = 0; i < count; ++i) {
      float& at = inverse_z[pixel[i]];
      at = value[i] > at ? value[i] : at;
    }
    count = 0;
  }
};

HWY_INLINE IntLanes fixed(hn::Vec<Floats> pixels) {
  const Floats floats;
  const auto kept =
      hn::Min(hn::Max(hn::Set(floats, -kMaxPixels), pixels), hn::Set(floats, kMaxPixels));
  return hn::NearestInt(hn::Mul(kept, hn::Set(floats, static_cast<float>(kFixedOne))));
}

HWY_INLINE IntLanes first_pixels(IntLanes fixed) {
  return hn::ShiftRight<kFixedBits>(hn::Add(fixed, hn::Set(Ints(), kFixedOne - 1)));
}

/// The pixel centres along one axis that lie between the corners, inside the image.
struct Range {
  IntLanes begin, end;
};

HWY_INLINE Range between(IntLanes low, IntLanes high, int size) {
  const Ints ints;
  return {hn::Max(first_pixels(low), hn::Zero(ints)),
          hn::Min(first_pixels(high), hn::Set(ints, size))};
}

HWY_INLINE IntLanes min_of(const IntLanes (&v)[3]) { return hn::Min(v[0], hn::Min(v[1], v[2])); }
HWY_INLINE IntLanes max_of(const IntLanes (&v)[3]) { return hn::Max(v[0], hn::Max(v[1], v[2])); }

/// Twice the signed area. Requires corners at max_of kMaxExtent apart.
HWY_INLINE IntLanes twice_area(const IntLanes (&x)[3], const IntLanes (&y)[3]) {
  return hn::Sub(hn::Mul(hn::Sub(x[1], x[0]), hn::Sub(y[2], y[0])),
                 hn::Mul(hn::Sub(x[2], x[0]), hn::Sub(y[1], y[0])));
}

/// The triangles within kMaxExtent whose back is visible: twice their area is positive, because y
/// points down. The test uses the same integers as the edges.
HWY_INLINE LaneMask shows_back(const IntLanes (&x)[3], const IntLanes (&y)[3]) {
  const Ints ints;
  const IntLanes extent = hn::Max(hn::Sub(max_of(x), min_of(x)), hn::Sub(max_of(y), min_of(y)));
  const auto small = hn::Lt(extent, hn::Set(ints, kMaxExtent * kFixedOne));
  return hn::RebindMask(Floats(), hn::And(small, hn::Gt(twice_area(x, y), hn::Zero(ints))));
}

/// Keeps the triangles of a block whose bounding box contains a pixel centre and whose side is
/// drawn. Appends the indices of triangles that must be clipped to `cut`.
HWY_INLINE void take_corners(const ScreenVertex* vertices, const std::array<uint32_t, 3>* triangles,
                             uint32_t first, size_t count, ImageSize size, Faces faces,
                             Corners& kept, std::vector<uint32_t>& cut) {
  alignas(64) float fetched[3][4 * kBlock];
  for (size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      std::memcpy(&fetched[k][4 * i], &vertices[triangles[first + i][k]], sizeof(ScreenVertex));
    }
  }
  const Floats floats;
  kept.count = 0;
  for (size_t i = 0; i < count; i += kLanes) {
    hn::Vec<Floats> x[3], y[3], inverse[3], z;
    for (int k = 0; k < 3; ++k) {
      hn::LoadInterleaved4(floats, &fetched[k][4 * i], x[k], y[k], z, inverse[k]);
    }
    const LaneMask there = hn::FirstN(floats, count - i);
    const auto min_inverse = hn::Min(inverse[0], hn::Min(inverse[1], inverse[2]));
    const LaneMask whole = hn::And(there, hn::Gt(min_inverse, hn::Zero(floats)));
    for (uint64_t clipped = bits_of(hn::AndNot(whole, there)); clipped != 0;
         clipped &= clipped - 1) {
      cut.push_back(first + static_cast<uint32_t>(i) +
                    static_cast<uint32_t>(std::countr_zero(clipped)));
    }
    const IntLanes fx[3] = {fixed(x[0]), fixed(x[1]), fixed(x[2])};
    const IntLanes fy[3] = {fixed(y[0]), fixed(y[1]), fixed(y[2])};
    const Range columns = between(min_of(fx), max_of(fx), size.width);
    const Range rows = between(min_of(fy), max_of(fy), size.height);
    const auto centres = hn::And(hn::Lt(columns.begin, columns.end), hn::Lt(rows.begin, rows.end));
    LaneMask kept_lanes = hn::And(whole, hn::RebindMask(floats, centres));
    if (faces == Faces::kFront) kept_lanes = hn::AndNot(shows_back(fx, fy), kept_lanes);
    const auto append = [&](hn::Vec<Floats> v, float* array) {
      hn::StoreU(hn::Compress(v, kept_lanes), floats, array + kept.count);
    };
    for (int k = 0; k < 3; ++k) {
      append(x[k], kept.x[k]);
      append(y[k], kept.y[k]);
      append(inverse[k], kept.inverse_z[k]);
    }
    kept.count += hn::CountTrue(floats, kept_lanes);
  }
}

/// Edge function: twice the area of the triangle formed by an edge and a pixel centre, with its
/// steps by column and row. It is not negative where the centre is on the inner side, or on an edge
/// that owns it.
struct Edge {
  IntLanes at_begin, per_column, per_row;
};

/// Edge from p to q at the pixel (column, row). Inside the triangle the function is not negative.
HWY_INLINE Edge edge(IntLanes px, IntLanes py, IntLanes qx, IntLanes qy, IntLanes column,
                     IntLanes row) {
  const Ints ints;
  const IntLanes dx = hn::Sub(qx, px), dy = hn::Sub(qy, py);
  const IntLanes x = hn::Sub(hn::ShiftLeft<kFixedBits>(column), px);
  const IntLanes y = hn::Sub(hn::ShiftLeft<kFixedBits>(row), py);
  // Left edges (they run upwards) and top edges own the centres that lie on them.
  const IntLanes zero = hn::Zero(ints);
  const auto owns = hn::Or(hn::Lt(dy, zero), hn::And(hn::Eq(dy, zero), hn::Gt(dx, zero)));
  const IntLanes bias = hn::IfThenZeroElse(owns, hn::Set(ints, 1));
  return {hn::Sub(hn::Sub(hn::Mul(dx, y), hn::Mul(dy, x)), bias),
          hn::Neg(hn::ShiftLeft<kFixedBits>(dy)), hn::ShiftLeft<kFixedBits>(dx)};
}

/// 1/z as a linear function of the image, relative to the first corner.
struct Plane {
  Lanes first_x, first_y, first, per_column, per_row, low, high;
};

HWY_INLINE Plane plane(const Corners& corners, size_t i) {
  const Floats floats;
  const auto load = [&](const float* array) { return Lanes(hn::LoadU(floats, array + i)); };
  const Lanes x0 = load(corners.x[0]), y0 = load(corners.y[0]);
  const Lanes v0 = load(corners.inverse_z[0]), v1 = load(corners.inverse_z[1]);
  const Lanes v2 = load(corners.inverse_z[2]);
  const Lanes x1 = load(corners.x[1]) - x0, y1 = load(corners.y[1]) - y0;
  const Lanes x2 = load(corners.x[2]) - x0, y2 = load(corners.y[2]) - y0;
  const Lanes area = x1 * y2 - x2 * y1;
  const auto defined = hn::Ge(hn::Abs(area.v), hn::Set(floats, kMinArea));
  const Lanes per_area(hn::IfThenElseZero(defined, reciprocal(area).v));
  return {x0,
          y0,
          v0,
          ((v1 - v0) * y2 - (v2 - v0) * y1) * per_area,
          ((v2 - v0) * x1 - (v1 - v0) * x2) * per_area,
          Lanes(hn::Min(v0.v, hn::Min(v1.v, v2.v))),
          Lanes(hn::Max(v0.v, hn::Max(v1.v, v2.v)))};
}

/// Draws the small triangles of one register, from `i` on. Returns the lanes of the other
/// triangles.
HWY_INLINE uint64_t draw_small(const Corners& corners, size_t i, ImageSize size, Samples& samples) {
  const Floats floats;
  const Ints ints;
  IntLanes x[3] = {hn::Zero(ints), hn::Zero(ints), hn::Zero(ints)};
  IntLanes y[3] = {hn::Zero(ints), hn::Zero(ints), hn::Zero(ints)};
  for (int k = 0; k < 3; ++k) {
    x[k] = fixed(hn::LoadU(floats, corners.x[k] + i));
    y[k] = fixed(hn::LoadU(floats, corners.y[k] + i));
  }
  const IntLanes left = min_of(x), right = max_of(x), top = min_of(y), bottom = max_of(y);
  const Range columns = between(left, right, size.width), rows = between(top, bottom, size.height);
  const IntLanes width = hn::Sub(columns.end, columns.begin);
  const IntLanes height = hn::Sub(rows.end, rows.begin);
  const IntLanes extent = hn::Max(hn::Sub(right, left), hn::Sub(bottom, top));
  const auto there = hn::RebindMask(ints, hn::FirstN(floats, corners.count - i));
  const auto small = hn::And(hn::Lt(extent, hn::Set(ints, kMaxExtent * kFixedOne)),
                             hn::Lt(hn::Max(width, height), hn::Set(ints, kMaxBox + 1)));
  const uint64_t others = bits_of(hn::RebindMask(floats, hn::AndNot(small, there)));

  // Order the corners so that the inside of the triangle is on the positive side of its edges.
  const IntLanes area = twice_area(x, y);
  const auto turned = hn::Lt(area, hn::Zero(ints));
  const IntLanes x1 = hn::IfThenElse(turned, x[2], x[1]), y1 = hn::IfThenElse(turned, y[2], y[1]);
  const IntLanes x2 = hn::IfThenElse(turned, x[1], x[2]), y2 = hn::IfThenElse(turned, y[1], y[2]);
  const Edge a = edge(x[0], y[0], x1, y1, columns.begin, rows.begin);
  const Edge b = edge(x1, y1, x2, y2, columns.begin, rows.begin);
  const Edge c = edge(x2, y2, x[0], y[0], columns.begin, rows.begin);
  const Plane value = plane(corners, i);

  const auto drawn = hn::AndNot(hn::Eq(area, hn::Zero(ints)), hn::And(there, small));
  const Lanes from_x = Lanes(hn::ConvertTo(floats, columns.begin)) - value.first_x;
  const Lanes from_y = Lanes(hn::ConvertTo(floats, rows.begin)) - value.first_y;
  IntLanes row_a = a.at_begin, row_b = b.at_begin, row_c = c.at_begin;
  IntLanes row_pixel = hn::Add(hn::Mul(rows.begin, hn::Set(ints, size.width)), columns.begin);
  for (int row = 0;; ++row) {
    const auto in_rows = hn::And(drawn, hn::Gt(height, hn::Set(ints, row)));
    if (hn::AllFalse(ints, in_rows)) break;
    const Lanes row_value = value.first + (from_y + static_cast<float>(row)) * value.per_row;
    IntLanes at_a = row_a, at_b = row_b, at_c = row_c;
    for (int column = 0;; ++column) {
      const auto in_box = hn::And(in_rows, hn::Gt(width, hn::Set(ints, column)));
      if (hn::AllFalse(ints, in_box)) break;
      const auto inside =
          hn::And(in_box, hn::Gt(hn::Or(at_a, hn::Or(at_b, at_c)), hn::Set(ints, -1)));
      const Lanes on_plane = row_value + (from_x + static_cast<float>(column)) * value.per_column;
      const auto kept = hn::Min(hn::Max(on_plane.v, value.low.v), value.high.v);
      const IntLanes pixel = hn::Add(row_pixel, hn::Set(ints, column));
      hn::StoreU(hn::Compress(pixel, inside), ints, samples.pixel + samples.count);
      hn::StoreU(hn::Compress(kept, hn::RebindMask(floats, inside)), floats,
                 samples.value + samples.count);
      samples.count += hn::CountTrue(ints, inside);
      at_a = hn::Add(at_a, a.per_column);
      at_b = hn::Add(at_b, b.per_column);
      at_c = hn::Add(at_c, c.per_column);
    }
    row_a = hn::Add(row_a, a.per_row);
    row_b = hn::Add(row_b, b.per_row);
    row_c = hn::Add(row_c, c.per_row);
    row_pixel = hn::Add(row_pixel, hn::Set(ints, size.width));
  }
  return others;
}

/// Keeps the larger 1/z at consecutive pixels.
HWY_INLINE void keep_nearest(float* pixels, int count, float first, float step, float low,
                             float high) {
  const Floats floats;
  const auto value = [&](int i) {
    const Lanes at(hn::Iota(floats, static_cast<float>(i)));
    const Lanes on_plane = Lanes(first) + Lanes(step) * at;
    return hn::Min(hn::Max(on_plane.v, hn::Set(floats, low)), hn::Set(floats, high));
  };
  constexpr int kStep = static_cast<int>(kLanes);
  int i = 0;
  for (; i + kStep <= count; i += kStep) {
    hn::StoreU(hn::Max(hn::LoadU(floats, pixels + i), value(i)), floats, pixels + i);
  }
  if (i < count) {
    alignas(64) float tail[kLanes];
    hn::Store(value(i), floats, tail);
    for (int k = 0; i + k < count; ++k) {
      pixels[i + k] = std::max(pixels[i + k], tail[k]);
    }
  }
}

void draw_large(const Corners& corners, size_t i, ImageSize size, float* inverse_z) {
  std::array<ScreenVertex, 3> corner;
  std::array<double, 3> value{};
  for (int k = 0; k < 3; ++k) {
    corner[k].x = corners.x[k][i];
    corner[k].y = corners.y[k][i];
    value[k] = corners.inverse_z[k][i];
  }
  const ScreenPlane across(corner, value);
  const auto [low, high] = std::minmax({value[0], value[1], value[2]});
  const auto min_value = static_cast<float>(low), max_value = static_cast<float>(high);
  for_each_span(corner, Band{size.width, 0, size.height}, [&](int y, int x_begin, int x_end) {
    keep_nearest(inverse_z + static_cast<size_t>(y) * size.width + x_begin, x_end - x_begin,
                 static_cast<float>(across(x_begin, y)), static_cast<float>(across.dx), min_value,
                 max_value);
  });
}

void draw_all(const ScreenVertex* vertices, std::span<const std::array<uint32_t, 3>> triangles,
              ImageSize size, Faces faces, float* inverse_z, std::vector<uint32_t>& cut) {
  Corners corners;
  Samples samples;
  for (size_t first = 0; first < triangles.size(); first += kBlock) {
    take_corners(vertices, triangles.data(), static_cast<uint32_t>(first),
                 std::min(kBlock, triangles.size() - first), size, faces, corners, cut);
    for (size_t i = 0; i < corners.count; i += kLanes) {
      for (uint64_t large = draw_small(corners, i, size, samples); large != 0; large &= large - 1) {
        draw_large(corners, i + static_cast<size_t>(std::countr_zero(large)), size, inverse_z);
      }
      if (samples.count > Samples::kCapacity) samples.write_to(inverse_z);
    }
  }
  samples.write_to(inverse_z);
}

Rect covered(const ScreenVertex* vertices, size_t count, ImageSize size) {
  const Floats floats;
  const float width = static_cast<float>(size.width), height = static_cast<float>(size.height);
  auto left = hn::Set(floats, width), top = hn::Set(floats, height);
  auto right = hn::Set(floats, -1.0F), bottom = hn::Set(floats, -1.0F);
  const auto include = [&](const float* vertex) {
    hn::Vec<Floats> x, y, z, inverse;
    hn::LoadInterleaved4(floats, vertex, x, y, z, inverse);
    const auto seen = hn::Gt(inverse, hn::Zero(floats));
    left = hn::IfThenElse(seen, hn::Min(left, x), left);
    right = hn::IfThenElse(seen, hn::Max(right, x), right);
    top = hn::IfThenElse(seen, hn::Min(top, y), top);
    bottom = hn::IfThenElse(seen, hn::Max(bottom, y), bottom);
  };
  size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    include(&vertices[i].x);
  }
  if (i < count) {
    float last[4 * kLanes] = {};
    std::memcpy(last, &vertices[i], (count - i) * sizeof(ScreenVertex));
    include(last);
  }
  const auto first_of = [&](auto v) {
    return static_cast<int>(std::max(0.0F, hn::GetLane(hn::MinOfLanes(floats, v))));
  };
  const auto end_of = [&](auto v, float limit) {
    return static_cast<int>(std::min(limit, hn::GetLane(hn::MaxOfLanes(floats, v)) + 2));
  };
  const Rect rect{first_of(left), first_of(top), 0, 0};
  return {rect.x0, rect.y0, std::max(0, end_of(right, width) - rect.x0),
          std::max(0, end_of(bottom, height) - rect.y0)};
}

void invert_all(float* values, int count) {
  for (int i = 0; i < count; ++i) {
    values[i] = values[i] > 0 ? 1.0F / values[i] : std::numeric_limits<float>::infinity();
  }
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(draw_all);
HWY_EXPORT(covered);
HWY_EXPORT(invert_all);

void draw_triangles(const std::vector<ScreenVertex>& vertices,
                    std::span<const std::array<uint32_t, 3>> triangles, ImageSize size, Faces faces,
                    float* inverse_z, std::vector<uint32_t>& cut) {
  HWY_DYNAMIC_DISPATCH(draw_all)(vertices.data(), triangles, size, faces, inverse_z, cut);
}

Rect covered_by(const std::vector<ScreenVertex>& vertices, ImageSize size) {
  return HWY_DYNAMIC_DISPATCH(covered)(vertices.data(), vertices.size(), size);
}

void invert(float* values, int count) { HWY_DYNAMIC_DISPATCH(invert_all)(values, count); }

namespace {

/// Working memory of one thread.
struct Workspace {
  std::vector<ScreenVertex> vertices;
  std::vector<uint32_t> cut;
};

/// Draws the remaining parts of triangles that extend behind the near plane or beyond the lens
/// model.
void draw_cut(const Mesh& mesh, const CameraModel& camera, const Workspace& work,
              DepthBuffer& buffer) {
  std::vector<ScreenTriangle> pieces;
  std::vector<ScreenVertex> corners;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (const uint32_t t : work.cut) {
    clip_to_near_plane(mesh, t, camera, work.vertices, pieces);
    for (const ScreenTriangle& piece : pieces) {
      const auto first = static_cast<uint32_t>(corners.size());
      corners.insert(corners.end(), piece.corner.begin(), piece.corner.end());
      triangles.push_back({first, first + 1, first + 2});
    }
  }
  std::vector<uint32_t> none;
  draw_triangles(corners, triangles, buffer.size, Faces::kBoth, buffer.z.data(), none);
}

void draw(const Mesh& mesh, const CameraModel& camera, Faces faces, Workspace& work,
          DepthBuffer& buffer) {
  constexpr float kNothing = std::numeric_limits<float>::infinity();
  const ImageSize size = camera.size();
  project_vertices(mesh, camera, work.vertices);
  work.cut.clear();
  // Parts of clipped triangles may lie anywhere in the image.
  const bool whole = std::all_of(work.vertices.begin(), work.vertices.end(),
                                 [](const ScreenVertex& v) { return v.on_screen(); });
  const Rect drawn = whole ? covered_by(work.vertices, size) : Rect{0, 0, size.width, size.height};
  buffer.size = size;
  buffer.z.assign(static_cast<size_t>(size.pixels()), kNothing);
  const auto row = [&](int y) {
    return buffer.z.data() + static_cast<size_t>(y) * size.width + drawn.x0;
  };
  for (int y = drawn.y0; y < drawn.y0 + drawn.height; ++y) {
    std::fill_n(row(y), drawn.width, 0.0F);
  }
  draw_triangles(work.vertices, mesh.triangles, size, faces, buffer.z.data(), work.cut);
  if (!work.cut.empty()) {
    draw_cut(mesh, camera, work, buffer);
  }
  for (int y = drawn.y0; y < drawn.y0 + drawn.height; ++y) {
    invert(row(y), drawn.width);
  }
}

}  // namespace

DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera, Faces faces) {
  Workspace work;
  DepthBuffer buffer;
  draw(mesh, camera, faces, work, buffer);
  return buffer;
}

void draw_depths(const Mesh& mesh, std::span<const CameraModel> cameras,
                 std::vector<DepthBuffer>& buffers, Faces faces) {
  buffers.resize(cameras.size());
  tbb::enumerable_thread_specific<Workspace> workspaces;
  tbb::parallel_for(size_t{0}, cameras.size(), [&](size_t i) {
    draw(mesh, cameras[i], faces, workspaces.local(), buffers[i]);
  });
}

}  // namespace v3d::recon
#endif
