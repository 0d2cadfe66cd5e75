#include <algorithm>
#include <cmath>

#include "v3dctl/scene/model.h"

namespace v3d::ctl {
namespace {

constexpr int kTexelsPerEdge = 3;      // of a subdivided triangle
constexpr int kMaxSubdivisions = 128;  // of an edge

// Lighting of docs/scene.md.
const Eigen::Vector3f kSunDirection = Eigen::Vector3f(-0.4F, -0.6F, 1).normalized();
constexpr float kSun = 0.5F;
constexpr float kSky = 0.65F;
constexpr float kGround = 0.35F;

float linear_of(float srgb) {
  return srgb <= 0.04045F ? srgb / 12.92F : std::pow((srgb + 0.055F) / 1.055F, 2.4F);
}

uint8_t srgb_of(float linear) {
  const float s =
      linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
  return static_cast<uint8_t>(std::lround(255 * std::clamp(s, 0.0F, 1.0F)));
}

ModelCorner interpolate(const std::array<ModelCorner, 3>& corners, float a, float b, float c) {
  return {a * corners[0].position + b * corners[1].position + c * corners[2].position,
          unit_or_zero(a * corners[0].normal + b * corners[1].normal + c * corners[2].normal),
          a * corners[0].colour + b * corners[1].colour + c * corners[2].colour,
          a * corners[0].uv + b * corners[1].uv + c * corners[2].uv};
}

int subdivisions(const std::array<ModelCorner, 3>& corners, const Image* texture) {
  if (texture == nullptr) return 1;
  const Eigen::Array2f texels(static_cast<float>(texture->size.width),
                              static_cast<float>(texture->size.height));
  float longest = 0;
  for (size_t k = 0; k < 3; ++k) {
    const Eigen::Array2f edge = (corners[(k + 1) % 3].uv - corners[k].uv).array() * texels;
    longest = std::max(longest, edge.matrix().norm());
  }
  const float count = std::ceil(longest / kTexelsPerEdge);
  return static_cast<int>(std::clamp(count, 1.0F, static_cast<float>(kMaxSubdivisions)));
}

/// Remainder from 0 to `size` - 1.
int64_t modulo(int64_t n, int64_t size) { return ((n % size) + size) % size; }

/// The row or column that lies at `n`, which can be outside of the texture.
int64_t wrapped(int64_t n, int64_t size, TextureWrap wrap) {
  if (wrap == TextureWrap::kClamp) return std::clamp(n, int64_t{0}, size - 1);
  if (wrap == TextureWrap::kRepeat) return modulo(n, size);
  const int64_t both = modulo(n, 2 * size);
  return both < size ? both : 2 * size - 1 - both;
}

Eigen::Vector3f texel(const ModelMaterial& material, int64_t x, int64_t y) {
  const Image& texture = *material.texture;
  const int64_t row = wrapped(y, texture.size.height, material.wrap_v);
  const int64_t column = wrapped(x, texture.size.width, material.wrap_u);
  const uint8_t* const rgb = texture.row(static_cast<int>(row)) + 3 * column;
  return {linear_of(rgb[0] / 255.0F), linear_of(rgb[1] / 255.0F), linear_of(rgb[2] / 255.0F)};
}

/// Bilinear sample of the texture in linear light.
Eigen::Vector3f sample(const ModelMaterial& material, const Eigen::Vector2f& uv) {
  const float x = uv.x() * static_cast<float>(material.texture->size.width) - 0.5F;
  const float y = uv.y() * static_cast<float>(material.texture->size.height) - 0.5F;
  const auto i = static_cast<int64_t>(std::floor(x)), j = static_cast<int64_t>(std::floor(y));
  const float s = x - static_cast<float>(i), t = y - static_cast<float>(j);
  return (1 - t) * ((1 - s) * texel(material, i, j) + s * texel(material, i + 1, j)) +
         t * ((1 - s) * texel(material, i, j + 1) + s * texel(material, i + 1, j + 1));
}

}  // namespace

Eigen::Vector3f unit_or_zero(const Eigen::Vector3f& v) {
  const Eigen::Vector3f unit = v.normalized();
  return unit.allFinite() && unit.norm() > 0.5F ? unit : Eigen::Vector3f::Zero().eval();
}

/// Divides the triangle into count * count triangles.
bool ModelSurfaceBuilder::add(const std::array<ModelCorner, 3>& corners,
                              const ModelMaterial& material) {
  const int count = subdivisions(corners, material.texture);
  Mesh& mesh = surface_.mesh;
  if (mesh.triangles.size() + static_cast<size_t>(count) * count > kMaxModelTriangles) {
    return false;
  }
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  for (int i = 0; i <= count; ++i) {
    for (int j = 0; j <= i; ++j) {
      const auto whole = static_cast<float>(count);
      add_vertex(interpolate(corners, static_cast<float>(count - i) / whole,
                             static_cast<float>(i - j) / whole, static_cast<float>(j) / whole),
                 material);
    }
  }
  const auto at = [&](int i, int j) { return first + static_cast<uint32_t>(i * (i + 1) / 2 + j); };
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j <= i; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      if (j < i) mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return true;
}

void ModelSurfaceBuilder::add_vertex(const ModelCorner& corner, const ModelMaterial& material) {
  surface_.mesh.vertices.push_back(corner.position);
  surface_.normals.push_back(corner.normal);
  Eigen::Vector3f albedo = material.factor.cwiseProduct(corner.colour);
  if (material.texture != nullptr) {
    albedo = albedo.cwiseProduct(sample(material, corner.uv));
  }
  surface_.albedo.push_back(albedo);
  surface_.unlit.push_back(material.unlit ? 1 : 0);
}

Mesh lit_model(const ModelSurface& model, const Eigen::Affine3d& world_from_model) {
  Mesh mesh;
  mesh.triangles = model.mesh.triangles;
  const Eigen::Affine3f place = world_from_model.cast<float>();
  for (size_t v = 0; v < model.mesh.vertices.size(); ++v) {
    mesh.vertices.push_back(place * model.mesh.vertices[v]);
    const Eigen::Vector3f normal = unit_or_zero(place.linear() * model.normals[v]);
    const float sky = 0.5F + 0.5F * normal.z();
    const float light =
        kGround + (kSky - kGround) * sky + kSun * std::max(0.0F, normal.dot(kSunDirection));
    const Eigen::Vector3f seen = (model.unlit[v] != 0 ? 1 : light) * model.albedo[v];
    mesh.colours.push_back({srgb_of(seen.x()), srgb_of(seen.y()), srgb_of(seen.z())});
  }
  return mesh;
}

}  // namespace v3d::ctl
