#include <algorithm>
#include <cmath>
#include <limits>

#include "base/core/error.h"
#include "sim/performer/performer.h"
#include "sim/rendering/noise.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3f;

/// Triangles of a closed mesh, sorted into columns parallel to z for upward rays.
class Columns {
 public:
  explicit Columns(const Mesh& mesh) : mesh_(&mesh) {
    min_.setConstant(std::numeric_limits<float>::max());
    max_ = -min_;
    for (const Vector3f& v : mesh.vertices) {
      min_ = min_.cwiseMin(v);
      max_ = max_.cwiseMax(v);
    }
    for (int axis = 0; axis < 2; ++axis) {
      scale_[axis] = kSide / std::max(1e-6F, (max_ - min_)[axis]);
    }
    cells_.resize(kSide * kSide);
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      insert(t);
    }
  }

  bool contains(const Vector3f& p) const {
    if ((p.array() < min_.array()).any() || (p.array() > max_.array()).any()) {
      return false;
    }
    int winding = 0;
    for (const uint32_t t : cells_[cell(p.y(), 1) * kSide + cell(p.x(), 0)]) {
      winding += crossing(mesh_->triangles[t], p);
    }
    return winding > 0;
  }

 private:
  static constexpr size_t kSide = 32;

  size_t cell(float v, int axis) const {
    const auto last = static_cast<float>(kSide - 1);
    return static_cast<size_t>(std::clamp((v - min_[axis]) * scale_[axis], 0.0F, last));
  }

  void insert(uint32_t t) {
    const auto& triangle = mesh_->triangles[t];
    const Vector3f& a = mesh_->vertices[triangle[0]];
    const Vector3f& b = mesh_->vertices[triangle[1]];
    const Vector3f& c = mesh_->vertices[triangle[2]];
    const Vector3f low = a.cwiseMin(b).cwiseMin(c);
    const Vector3f high = a.cwiseMax(b).cwiseMax(c);
    for (size_t j = cell(low.y(), 1); j <= cell(high.y(), 1); ++j) {
      for (size_t i = cell(low.x(), 0); i <= cell(high.x(), 0); ++i) {
        cells_[j * kSide + i].push_back(t);
      }
    }
  }

  /// +1 where the upward ray from p leaves through the triangle, -1 where it enters, else 0. The
  /// crossing test is half-open, so an edge belongs to one triangle and does not count twice.
  int crossing(const std::array<uint32_t, 3>& triangle, const Vector3f& p) const {
    const Eigen::Vector3d q = p.cast<double>();
    int turns = 0;
    Eigen::Vector3d v[3];
    for (int k = 0; k < 3; ++k) {
      v[k] = mesh_->vertices[triangle[static_cast<size_t>(k)]].cast<double>() - q;
    }
    // Winding number of the projected triangle around the origin, from upward and downward edges.
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d& a = v[k];
      const Eigen::Vector3d& b = v[(k + 1) % 3];
      if ((a.y() <= 0) == (b.y() <= 0)) {
        continue;
      }
      const double side = a.x() * b.y() - a.y() * b.x();
      if (b.y() > a.y() && side > 0) {
        ++turns;
      } else if (b.y() < a.y() && side < 0) {
        --turns;
      }
    }
    if (turns == 0) {
      return 0;
    }
    const Eigen::Vector3d ab = v[1] - v[0];
    const Eigen::Vector3d ac = v[2] - v[0];
    const Eigen::Vector3d normal(ab.y() * ac.z() - ab.z() * ac.y(),
                                 ab.z() * ac.x() - ab.x() * ac.z(),
                                 ab.x() * ac.y() - ab.y() * ac.x());
    const double height = normal.dot(v[0]) / normal.z();
    return height > 0 ? turns : 0;
  }

  const Mesh* mesh_;
  Vector3f min_, max_;
  float scale_[2] = {0, 0};
  std::vector<std::vector<uint32_t>> cells_;
};

uint8_t to_byte(float v) { return static_cast<uint8_t>(std::clamp(v, 0.0F, 1.0F) * 255 + 0.5F); }

void append_visible(Mesh& out, const Part& part, const std::vector<bool>& hidden, uint64_t seed) {
  constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> index(part.mesh.vertices.size(), kNone);
  for (const auto& t : part.mesh.triangles) {
    if (hidden[t[0]] || hidden[t[1]] || hidden[t[2]]) {
      continue;
    }
    std::array<uint32_t, 3> kept{};
    for (size_t k = 0; k < 3; ++k) {
      uint32_t& at = index[t[k]];
      if (at == kNone) {
        at = static_cast<uint32_t>(out.vertices.size());
        out.vertices.push_back(part.mesh.vertices[t[k]]);
        const Vector3f colour = paint(part.material, part.paint[t[k]], seed, part.palette);
        out.colours.push_back({to_byte(colour.x()), to_byte(colour.y()), to_byte(colour.z())});
      }
      kept[k] = at;
    }
    out.triangles.push_back(kept);
  }
}

}  // namespace

bool is_inside(const Mesh& mesh, const Vector3f& point) { return Columns(mesh).contains(point); }

Mesh outer_surface(const std::vector<Part>& parts, uint64_t seed) {
  std::vector<Columns> columns;
  columns.reserve(parts.size());
  for (const Part& part : parts) {
    columns.emplace_back(part.mesh);
  }
  Mesh out;
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto& vertices = parts[i].mesh.vertices;
    std::vector<bool> hidden(vertices.size());
    for (size_t v = 0; v < vertices.size(); ++v) {
      for (size_t other = 0; other < parts.size() && !hidden[v]; ++other) {
        hidden[v] = other != i && columns[other].contains(vertices[v]);
      }
    }
    append_visible(out, parts[i], hidden, seed);
  }
  return out;
}

namespace {

PointGroup group_of(const Part& part) {
  switch (part.material) {
    case Material::kBlade:
    case Material::kHandle:
    case Material::kGuard:
      return PointGroup::kSword;
    default:
      return part.is_sleeve ? PointGroup::kSleeve : PointGroup::kOther;
  }
}

double area_of(const Mesh& mesh, const std::array<uint32_t, 3>& t) {
  const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>();
  return 0.5 * (mesh.vertices[t[1]].cast<double>() - a)
                   .cross(mesh.vertices[t[2]].cast<double>() - a)
                   .norm();
}

}  // namespace

SurfacePoints::SurfacePoints(const std::vector<Part>& parts, size_t count, uint64_t seed) {
  std::vector<double> until;  // area of all triangles up to each
  std::vector<Point> triangles;
  for (uint32_t p = 0; p < parts.size(); ++p) {
    for (uint32_t t = 0; t < parts[p].mesh.triangles.size(); ++t) {
      const double before = until.empty() ? 0 : until.back();
      until.push_back(before + area_of(parts[p].mesh, parts[p].mesh.triangles[t]));
      triangles.push_back({p, t, Eigen::Vector3f::Zero()});
    }
  }
  if (until.empty() || until.back() <= 0) return;
  for (uint64_t i = 0; i < count; ++i) {
    const double area = uniform(seed, 3 * i, 0, until.back());
    const auto at = std::upper_bound(until.begin(), until.end() - 1, area) - until.begin();
    Point point = triangles[static_cast<size_t>(at)];
    // Evenly in a triangle.
    const double root = std::sqrt(uniform(seed, 3 * i + 1, 0, 1));
    const double along = uniform(seed, 3 * i + 2, 0, 1);
    point.weights = Eigen::Vector3d(1 - root, root * (1 - along), root * along).cast<float>();
    points_.push_back(point);
    groups_.push_back(group_of(parts[point.part]));
  }
}

std::array<Eigen::Vector3f, 3> SurfacePoints::corners(const std::vector<Part>& parts,
                                                      const Point& point) {
  V3D_CHECK(point.part < parts.size());
  const Mesh& mesh = parts[point.part].mesh;
  const auto& [a, b, c] = mesh.triangles[point.triangle];
  return {mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]};
}

std::vector<Eigen::Vector3f> SurfacePoints::positions(const std::vector<Part>& parts) const {
  std::vector<Eigen::Vector3f> positions;
  for (const Point& point : points_) {
    const auto [a, b, c] = corners(parts, point);
    positions.push_back(point.weights[0] * a + point.weights[1] * b + point.weights[2] * c);
  }
  return positions;
}

std::vector<Eigen::Vector3f> SurfacePoints::normals(const std::vector<Part>& parts) const {
  std::vector<Eigen::Vector3f> normals;
  for (const Point& point : points_) {
    const auto [a, b, c] = corners(parts, point);
    normals.push_back((b - a).cross(c - a).normalized());
  }
  return normals;
}

}  // namespace v3d::sim
