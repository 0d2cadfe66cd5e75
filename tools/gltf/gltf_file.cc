#include "gltf/gltf_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// Component of an accessor as a float; integers are normalised to 0 to 1, or -1 to 1.
float number_at(const unsigned char* at, int component) {
  const auto as = [&]<class T>(T) {
    T value;
    std::memcpy(&value, at, sizeof value);
    return value;
  };
  switch (component) {
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return as(float{});
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return std::max(as(int8_t{}) / 127.0F, -1.0F);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return std::max(static_cast<float>(as(int16_t{})) / 32767.0F, -1.0F);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return as(uint8_t{}) / 255.0F;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return static_cast<float>(as(uint16_t{})) / 65535.0F;
    default:
      return 0;
  }
}

// --- callbacks of tinygltf

/// Hides files outside of the model's folder: tinygltf also searches the working directory.
bool is_in_folder(const std::string& path, void* folder) {
  return lies_within(path, *static_cast<const fs::path*>(folder));
}

std::string same_path(const std::string& path, void*) { return path; }

bool read_beside(std::vector<unsigned char>* bytes, std::string* error, const std::string& path,
                 void*) {
  const auto text = io::read_file(path, GltfFile::kMaxBytes);
  if (!text) {
    *error = text.error().message;
    return false;
  }
  bytes->assign(text->begin(), text->end());
  return true;
}

/// The callbacks above, for files in `folder`. tinygltf 2.9 (Debian 13) ignores a set that lacks
/// one. Template: tinygltf of Debian 12 has no callback for sizes.
template <class Callbacks>
Callbacks callbacks_in(fs::path& folder) {
  Callbacks callbacks{};
  callbacks.FileExists = is_in_folder;
  callbacks.ExpandFilePath = same_path;
  callbacks.ReadWholeFile = read_beside;
  callbacks.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&,
                                void*) { return false; };
  if constexpr (requires { callbacks.GetFileSizeInBytes; }) {
    // Not used: read_beside() limits the size.
    callbacks.GetFileSizeInBytes = [](size_t* bytes, std::string*, const std::string&, void*) {
      *bytes = 0;
      return true;
    };
  }
  callbacks.user_data = &folder;
  return callbacks;
}

/// Keeps an image encoded.
bool keep_bytes(tinygltf::Image* image, int, std::string*, std::string*, int, int,
                const unsigned char* bytes, int size, void*) {
  image->image.assign(bytes, bytes + size);
  return true;
}

bool is_binary(std::string_view bytes) { return bytes.starts_with("glTF"); }

/// First chunk of a binary file; otherwise the whole file. Empty for a truncated one.
std::string_view json_of(std::string_view bytes) {
  constexpr size_t kHead = 20;
  if (!is_binary(bytes)) return bytes;
  uint32_t length = 0;
  if (bytes.size() >= kHead) std::memcpy(&length, bytes.data() + 12, sizeof length);
  if (bytes.size() < kHead || length > bytes.size() - kHead) return {};
  return bytes.substr(kHead, length);
}

}  // namespace

Eigen::Affine3d GltfNodeTransform::parent_from_node() const {
  if (matrix) return *matrix;
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  transform.translate(translation);
  transform.rotate(rotation);
  transform.scale(scale);
  return transform;
}

GltfNodeTransform transform_of(const tinygltf::Node& node) {
  GltfNodeTransform transform;
  if (node.matrix.size() == 16) {
    transform.matrix.emplace(
        Eigen::Matrix4d(Eigen::Map<const Eigen::Matrix4d>(node.matrix.data())));
  }
  if (node.translation.size() == 3) {
    transform.translation = Eigen::Map<const Eigen::Vector3d>(node.translation.data());
  }
  if (node.rotation.size() == 4) {
    const std::vector<double>& xyzw = node.rotation;
    transform.rotation = Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]).normalized();
  }
  if (node.scale.size() == 3) {
    transform.scale = Eigen::Map<const Eigen::Vector3d>(node.scale.data());
  }
  return transform;
}

GltfFile GltfFile::open(const fs::path& path) {
  return {io::value_or_throw(io::read_file(path, kMaxBytes)), path};
}

GltfFile::GltfFile(std::string_view bytes, fs::path path) : path_(std::move(path)) {
  const std::string_view json = json_of(bytes);
  if (json.empty() && is_binary(bytes)) fail("is no glTF 2.0: truncated");
  check_gltf(json, path_);
  try {
    load(bytes);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception&) {  // of tinygltf and its JSON parser
    fail("is a damaged glTF");
  }
}

void GltfFile::fail(const std::string& what) const {
  throw InputError(path_.string() + ": " + what);
}

void GltfFile::load(std::string_view bytes) {
  std::error_code none;
  fs::path folder = fs::canonical(path_.has_parent_path() ? path_.parent_path() : ".", none);
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(callbacks_in<tinygltf::FsCallbacks>(folder));
  loader.SetImageLoader(keep_bytes, nullptr);
  std::string error, warning;
  const auto size = static_cast<unsigned int>(bytes.size());
  const auto* const first = reinterpret_cast<const unsigned char*>(bytes.data());
  const bool loaded =
      is_binary(bytes)
          ? loader.LoadBinaryFromMemory(&model_, &error, &warning, first, size, folder)
          : loader.LoadASCIIFromString(&model_, &error, &warning, bytes.data(), size, folder);
  if (!loaded) fail(error.empty() ? "is no glTF 2.0" : error.substr(0, error.find('\n')));
}

/// Bytes of element `n` of an accessor. Requires n < count.
const unsigned char* GltfFile::element(const tinygltf::Accessor& accessor, size_t n,
                                       size_t bytes) const {
  const tinygltf::BufferView& view = of(model_.bufferViews, accessor.bufferView);
  const auto& data = of(model_.buffers, view.buffer).data;
  const int stride = accessor.ByteStride(view);
  const size_t at = view.byteOffset + accessor.byteOffset + n * static_cast<size_t>(stride);
  if (stride <= 0 || at > data.size() || bytes > data.size() - at) fail("is a damaged glTF");
  return data.data() + at;
}

GltfFile::Rows GltfFile::open_rows(int accessor, size_t width, const std::string& name) {
  const tinygltf::Accessor& opened = of(model_.accessors, accessor);
  if (opened.sparse.isSparse) fail(name + " is sparse, which is not read here");
  if (opened.count > kMaxRows - rows_read_) {
    fail(
        "is too large: more than 48 million rows of attributes, counted for every node that "
        "shows them");
  }
  rows_read_ += opened.count;
  const int bytes = tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(opened.componentType));
  const int components = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(opened.type));
  if (bytes <= 0 || components < static_cast<int>(width)) fail("is a damaged glTF");
  return {&opened, static_cast<size_t>(bytes)};
}

std::vector<float> GltfFile::numbers(int accessor, size_t width, const std::string& name,
                                     const std::string& row) {
  const Rows rows = open_rows(accessor, width, name);
  std::vector<float> values;
  for (size_t n = 0; n < rows.accessor->count; ++n) {
    const auto* at = element(*rows.accessor, n, rows.component_bytes * width);
    for (size_t k = 0; k < width; ++k) {
      values.push_back(number_at(at + k * rows.component_bytes, rows.accessor->componentType));
      if (!(std::abs(values.back()) <= kMaxValue)) {
        fail(name + ": " + row + " " + std::to_string(n) +
             " is not finite, or beyond a thousand million; expected finite numbers");
      }
    }
  }
  return values;
}

std::vector<uint32_t> GltfFile::integers(int accessor, size_t width, const std::string& name) {
  const Rows rows = open_rows(accessor, width, name);
  std::vector<uint32_t> values;
  for (size_t n = 0; n < rows.accessor->count; ++n) {
    const auto* at = element(*rows.accessor, n, rows.component_bytes * width);
    for (size_t k = 0; k < width; ++k) {
      uint32_t value = 0;  // little-endian, as glTF and this machine
      std::memcpy(&value, at + k * rows.component_bytes,
                  std::min(sizeof value, rows.component_bytes));
      values.push_back(value);
    }
  }
  return values;
}

}  // namespace v3d
