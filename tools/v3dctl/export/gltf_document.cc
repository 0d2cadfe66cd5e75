#include "v3dctl/export/gltf_document.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <numbers>
#include <utility>

#include "base/core/error.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;

constexpr int kFloat = static_cast<int>(Component::kFloat);
constexpr int kLinear = 9729, kClampToEdge = 33071;

void put_word(std::string& bytes, size_t word) {
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift & 0xFF);
}

void put_chunk_header(std::string& bytes, size_t type, size_t length) {
  put_word(bytes, length);
  put_word(bytes, type);
}

void fill_to_word(std::string& bytes, char filler) {
  bytes.resize((bytes.size() + 3) / 4 * 4, filler);
}

/// Minimum and maximum of each component.
void set_bounds(json& accessor, std::span<const float> values, size_t width) {
  std::vector<float> low(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(width));
  std::vector<float> high = low;
  for (size_t i = 0; i < values.size(); ++i) {
    low[i % width] = std::min(low[i % width], values[i]);
    high[i % width] = std::max(high[i % width], values[i]);
  }
  accessor["min"] = low;
  accessor["max"] = high;
}

}  // namespace

GltfDocument::GltfDocument() {
  gltf_["asset"] = {{"version", "2.0"}, {"generator", "v3dctl " V3D_VERSION}};
  gltf_["scene"] = 0;
  add("scenes", json::object());
}

size_t GltfDocument::add(const char* list, json item) {
  gltf_[list].push_back(std::move(item));
  return gltf_[list].size() - 1;
}

size_t GltfDocument::add_buffer() {
  json buffer;
  buffer["byteLength"] = 0;
  return add("buffers", std::move(buffer));
}

size_t GltfDocument::append(std::span<const uint8_t> bytes) {
  fill_to_word(binary_, '\0');
  const size_t at = binary_.size();
  binary_.append(bytes.begin(), bytes.end());
  return at;
}

size_t GltfDocument::add_view(std::span<const uint8_t> bytes, int target) {
  json view = {{"buffer", 0}, {"byteOffset", append(bytes)}, {"byteLength", bytes.size()}};
  if (target != 0) view["target"] = target;
  return add("bufferViews", std::move(view));
}

size_t GltfDocument::add_attribute(const VertexStream& stream, size_t vertices) {
  json accessor = accessor_of(stream, vertices);
  accessor["bufferView"] = add_view(stream.bytes, kArrayBuffer);
  if (stream.semantic == "POSITION" && stream.component == Component::kFloat) {
    std::vector<float> values(stream.bytes.size() / sizeof(float));
    std::memcpy(values.data(), stream.bytes.data(), stream.bytes.size());
    set_bounds(accessor, values, 3);
  }
  return add("accessors", std::move(accessor));
}

size_t GltfDocument::add_indices(const std::vector<uint32_t>& indices) {
  const auto* bytes = reinterpret_cast<const uint8_t*>(indices.data());
  json accessor = accessor_of_indices(indices.size());
  accessor["bufferView"] =
      add_view({bytes, indices.size() * sizeof(uint32_t)}, kElementArrayBuffer);
  return add("accessors", std::move(accessor));
}

size_t GltfDocument::add_floats(const std::vector<float>& values, size_t width, bool bounded) {
  const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
  const std::map<size_t, const char*> types{{1, "SCALAR"}, {3, "VEC3"}, {4, "VEC4"}, {16, "MAT4"}};
  json accessor = {{"componentType", kFloat},
                   {"type", types.at(width)},
                   {"count", values.size() / width},
                   {"bufferView", add_view({bytes, values.size() * sizeof(float)})}};
  if (bounded) set_bounds(accessor, values, width);
  return add("accessors", std::move(accessor));
}

void GltfDocument::animate(json& animation, size_t node, const char* path,
                           const char* interpolation, const std::vector<float>& times,
                           const std::vector<float>& values, size_t width) {
  animation["samplers"].push_back({{"input", add_floats(times, 1, true)},
                                   {"output", add_floats(values, width, false)},
                                   {"interpolation", interpolation}});
  animation["channels"].push_back({{"sampler", animation["samplers"].size() - 1},
                                   {"target", {{"node", node}, {"path", path}}}});
}

size_t GltfDocument::add_unlit_material() {
  constexpr const char* kUnlit = "KHR_materials_unlit";
  json material;
  material["name"] = "as seen";
  material["pbrMetallicRoughness"]["metallicFactor"] = 0;
  material["extensions"][kUnlit] = json::object();
  json& used = gltf_["extensionsUsed"];
  if (std::find(used.begin(), used.end(), json(kUnlit)) == used.end()) used.push_back(kUnlit);
  return add("materials", std::move(material));
}

void GltfDocument::set_texture(size_t material, std::span<const uint8_t> jpeg) {
  const size_t image = add("images", {{"mimeType", "image/jpeg"}, {"bufferView", add_view(jpeg)}});
  const size_t sampler = add("samplers", {{"magFilter", kLinear},
                                          {"minFilter", kLinear},
                                          {"wrapS", kClampToEdge},
                                          {"wrapT", kClampToEdge}});
  const size_t texture = add("textures", {{"source", image}, {"sampler", sampler}});
  gltf_["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = texture;
}

std::string GltfDocument::bytes() {
  if (!binary_.empty()) gltf_["buffers"][0]["byteLength"] = binary_.size();
  std::string text = gltf_.dump();
  fill_to_word(text, ' ');
  fill_to_word(binary_, '\0');
  const size_t size = 20 + text.size() + (binary_.empty() ? 0 : 8 + binary_.size());
  if (size > kMaxGlbBytes) {
    throw InputError("a GLB file contains at most 4 GB, not " + std::to_string(size) +
                     " bytes; expected fewer --frames");
  }
  std::string file = "glTF";
  file.reserve(size);
  put_word(file, 2);
  put_word(file, size);
  put_chunk_header(file, 0x4E4F534A, text.size());  // "JSON"
  file += text;
  if (!binary_.empty()) {
    put_chunk_header(file, 0x004E4942, binary_.size());
    file += binary_;
  }
  return file;
}

json accessor_of(const VertexStream& stream, size_t vertices) {
  const std::string type = stream.width == 1 ? "SCALAR" : "VEC" + std::to_string(stream.width);
  json accessor = {
      {"componentType", static_cast<int>(stream.component)}, {"type", type}, {"count", vertices}};
  if (stream.normalised) accessor["normalized"] = true;
  return accessor;
}

json accessor_of_indices(size_t count) {
  return {{"componentType", kUnsignedInt}, {"type", "SCALAR"}, {"count", count}};
}

json timecode_extras(int64_t pulse, const take::PulseTimecode& timecode) {
  return {{"pulse", pulse}, {"timecode", timecode.text()}, {"timecode_rate", name(timecode.rate)}};
}

json y_up_rotation() {
  const double half = std::numbers::sqrt2 / 2;
  return {-half, 0, 0, half};
}

}  // namespace v3d::ctl
