// Parser of GLB files for tests; checks the chunk structure.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

namespace v3d::test {

struct Glb {
  nlohmann::json scene;
  std::string buffer;

  const nlohmann::json& primitive() const { return scene["meshes"][0]["primitives"][0]; }
  const nlohmann::json& accessor(const char* semantic) const {
    return scene["accessors"][primitive()["attributes"][semantic].get<size_t>()];
  }
  const nlohmann::json& indices() const {
    return scene["accessors"][primitive()["indices"].get<size_t>()];
  }
  std::string bytes_of(const nlohmann::json& accessor) const {
    const nlohmann::json& view = scene["bufferViews"][accessor.at("bufferView").get<size_t>()];
    return buffer.substr(view.at("byteOffset"), view.at("byteLength"));
  }
};

inline uint32_t word_at(const std::string& bytes, size_t offset) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  return word;
}

inline Glb parse_glb(const std::string& bytes) {
  Glb glb;
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word_at(bytes, 4), 2U);
  EXPECT_EQ(word_at(bytes, 8), bytes.size());
  const size_t json_size = word_at(bytes, 12);
  EXPECT_EQ(json_size % 4, 0U);
  EXPECT_EQ(word_at(bytes, 16), 0x4E4F534AU);
  glb.scene = nlohmann::json::parse(bytes.substr(20, json_size));
  if (bytes.size() == 20 + json_size) return glb;
  const size_t buffer_at = 20 + json_size;
  EXPECT_EQ(word_at(bytes, buffer_at) % 4, 0U);
  EXPECT_EQ(word_at(bytes, buffer_at + 4), 0x004E4942U);
  glb.buffer = bytes.substr(buffer_at + 8);
  EXPECT_EQ(glb.buffer.size(), word_at(bytes, buffer_at));
  return glb;
}

/// The sRGB value, 0 to 255, of linear light.
inline uint8_t srgb_of(double linear) {
  const double s = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(255 * s));
}

}  // namespace v3d::test
