// A tiny skinned body as a binary glTF file in memory: a column that is open at the neck and has a
// seam, and a head. Joints rig:Hips, rig:Head and rig:LeftFoot; animations Walk (travels 1 m in 1
// s) and Nod (its last key differs from the first).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace v3d::sim {

class TinyBody {
 public:
  TinyBody() {
    json_ = {{"asset", {{"version", "2.0"}}},
             {"scene", 0},
             {"scenes", {{{"nodes", {0, 4}}}}},
             {"nodes",
              {{{"name", "Armature"}, {"children", {1}}},
               {{"name", "rig:Hips"}, {"translation", {0, 0.9, 0}}, {"children", {2, 3}}},
               {{"name", "rig:Head"}, {"translation", {0, 0.6, 0}}},
               {{"name", "rig:LeftFoot"}, {"translation", {0.1, -0.8, 0}}},
               {{"name", "Body"}, {"mesh", 0}, {"skin", 0}}}},
             {"skins", {{{"joints", {1, 2, 3}}}}}};
    add_skin();
    json_["meshes"] = {{{"primitives", {column(), head()}}}};
    add_animations();
  }

  /// The parts of the file, for changes.
  nlohmann::json& json() { return json_; }
  nlohmann::json& primitive(size_t n) { return json_["meshes"][0]["primitives"][n]; }
  nlohmann::json& accessor(const nlohmann::json& index) {
    return json_["accessors"][index.get<size_t>()];
  }
  /// Replaces component `k` of the elements of an accessor, counted through all rows.
  template <class T>
  void set(const nlohmann::json& index, size_t k, T value) {
    const auto view = accessor(index)["bufferView"].get<size_t>();
    const auto begin = json_["bufferViews"][view]["byteOffset"].get<size_t>();
    std::memcpy(bytes_.data() + begin + k * sizeof value, &value, sizeof value);
  }

  /// The bytes of the .glb file.
  std::string file() const {
    nlohmann::json json = json_;
    json["buffers"] = {{{"byteLength", bytes_.size()}}};
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file = "glTF";
    const auto add = [&](size_t value) {
      const auto number = static_cast<uint32_t>(value);
      file.append(reinterpret_cast<const char*>(&number), sizeof number);
    };
    add(2);
    add(12 + 8 + text.size() + 8 + bytes_.size());
    add(text.size());
    file += "JSON" + text;
    add(bytes_.size());
    file += std::string("BIN\0", 4) + bytes_;
    return file;
  }

 private:
  static constexpr int kFloat = 5126, kShort = 5123, kByte = 5121;

  template <class T>
  size_t add(const std::vector<T>& values, const char* type, int component, size_t width) {
    json_["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", values.size() * sizeof(T)}});
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    json_["accessors"].push_back({{"bufferView", json_["bufferViews"].size() - 1},
                                  {"componentType", component},
                                  {"count", values.size() / width},
                                  {"type", type}});
    return json_["accessors"].size() - 1;
  }

  void add_skin() {
    std::vector<float> matrices;
    for (const std::array<float, 3>& at :
         {std::array{0.0F, 0.9F, 0.0F}, {0.0F, 1.5F, 0.0F}, {0.1F, 0.1F, 0.0F}}) {
      for (const float value :
           {1.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}) {
        matrices.push_back(value);
      }
      for (const float value : at) matrices.push_back(-value);
      matrices.push_back(1);
    }
    json_["skins"][0]["inverseBindMatrices"] = add(matrices, "MAT4", kFloat, 16);
  }

  struct Vertices {
    std::vector<float> positions, weights;
    std::vector<uint8_t> joints;
    /// `head`: share of the head; the hips have the rest.
    void add(float x, float y, float z, float head) {
      for (const float value : {x, y, z}) positions.push_back(value);
      for (const float value : {1 - head, head, 0.0F, 0.0F}) weights.push_back(value);
      for (const int value : {0, 1, 0, 0}) joints.push_back(static_cast<uint8_t>(value));
    }
  };

  nlohmann::json primitive_of(const Vertices& vertices, const std::vector<uint16_t>& indices) {
    nlohmann::json primitive;
    primitive["attributes"]["POSITION"] = add(vertices.positions, "VEC3", kFloat, 3);
    primitive["attributes"]["JOINTS_0"] = add(vertices.joints, "VEC4", kByte, 4);
    primitive["attributes"]["WEIGHTS_0"] = add(vertices.weights, "VEC4", kFloat, 4);
    primitive["indices"] = add(indices, "SCALAR", kShort, 1);
    return primitive;
  }

  /// Rings of 5 vertices, the last at the position of the first; counter-clockwise from above.
  static void add_rings(Vertices& vertices, std::vector<uint16_t>& indices,
                        const std::vector<std::array<float, 3>>& heights_sides_heads) {
    const size_t first = vertices.positions.size() / 3;
    for (const auto& [y, side, head] : heights_sides_heads) {
      for (int k = 0; k < 5; ++k) {
        const bool front = k % 4 == 0 || k == 1, left = k % 4 == 1 || k == 2;
        vertices.add(left ? side : -side, y, front ? side : -side, head);
      }
    }
    for (size_t ring = 0; ring + 1 < heights_sides_heads.size(); ++ring) {
      for (size_t k = 0; k < 4; ++k) {
        const size_t a = first + 5 * ring + k;
        for (const size_t v : {a, a + 1, a + 6, a, a + 6, a + 5}) {
          indices.push_back(static_cast<uint16_t>(v));
        }
      }
    }
  }

  nlohmann::json column() {
    Vertices vertices;
    std::vector<uint16_t> indices = {0, 2, 1, 0, 3, 2};  // the bottom
    add_rings(vertices, indices, {{0.0F, 0.2F, 0.0F}, {0.9F, 0.2F, 0.0F}, {1.5F, 0.15F, 0.5F}});
    return primitive_of(vertices, indices);
  }

  nlohmann::json head() {
    Vertices vertices;
    std::vector<uint16_t> indices = {0, 2, 1, 0, 3, 2, 5, 6, 7, 5, 7, 8};  // bottom and top
    add_rings(vertices, indices, {{1.45F, 0.1F, 1.0F}, {1.7F, 0.1F, 1.0F}});
    return primitive_of(vertices, indices);
  }

  void add_animation(const char* name, int node, const char* path, const std::vector<float>& values,
                     const char* type) {
    const std::vector<float> times = {0, 0.5F, 1};
    json_["animations"].push_back(
        {{"name", name},
         {"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}}}},
         {"samplers",
          {{{"input", add(times, "SCALAR", kFloat, 1)},
            {"output", add(values, type, kFloat, values.size() / 3)},
            {"interpolation", "LINEAR"}}}}});
  }

  void add_animations() {
    const auto about_x = [](double degrees) {
      const double half = degrees * 3.14159265358979 / 360;
      return std::array{static_cast<float>(std::sin(half)), static_cast<float>(std::cos(half))};
    };
    const auto [s1, c1] = about_x(30);
    const auto [s2, c2] = about_x(20);
    add_animation("Walk", 1, "translation", {0, 0.9F, 0, 0, 0.95F, 0.5F, 0, 0.9F, 1}, "VEC3");
    add_animation("Nod", 2, "rotation", {0, 0, 0, 1, s1, 0, 0, c1, s2, 0, 0, c2}, "VEC4");
  }

  nlohmann::json json_;
  std::string bytes_;
};

}  // namespace v3d::sim
