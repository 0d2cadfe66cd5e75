// Reader of untrusted glTF 2.0 files: what is common to models of scenes and to performers.
#pragma once

#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

// Checks of untrusted glTF 2.0 files that tinygltf does not do.

/// Maximum number of ancestors of a node.
inline constexpr int kMaxNodeDepth = 64;

/// Checks the JSON of `file` before tinygltf reads it:
/// - it has at most 64 levels and 4 million values, and requires no extension except of materials
///   and KHR_texture_transform;
/// - the nodes are trees: each is the child of at most one node and not its own ancestor, and
///   scenes name roots, each once (chapters 3.5.2 and 5.25);
/// - every `uri` of a buffer or an image is data, or names a regular file in the folder of `file`
///   or below it, links resolved (RFC 3986 paths without scheme, authority, root or "..");
/// - every buffer view lies within its buffer.
/// Throws InputError: the file, the place in it, and what is expected.
/// Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
void check_gltf(std::string_view text, const std::filesystem::path& file);

/// Whether `path` exists and lies in `folder` or below it, symbolic links resolved in both.
bool lies_within(const std::filesystem::path& path, const std::filesystem::path& folder);

/// The transform of a node relative to its parent: a matrix, or translation, rotation (unit length)
/// and scale.
struct GltfNodeTransform {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  std::optional<Eigen::Affine3d> matrix;

  Eigen::Affine3d parent_from_node() const;
};

GltfNodeTransform transform_of(const tinygltf::Node& node);

/// A checked file. A bad index in it is an InputError and never a read out of bounds. One caller at
/// a time.
class GltfFile {
 public:
  static constexpr uint64_t kMaxBytes = 512 << 20;
  /// Limit of the rows of accessors that are read, counted again for every call.
  static constexpr size_t kMaxRows = 48'000'000;
  /// Limit of a number of an accessor. Products of a few such numbers are finite in float.
  static constexpr float kMaxValue = 1e9F;

  /// Reads a binary or JSON file of at most 512 MB; it may refer to files in its folder only.
  /// Images stay encoded. Throws InputError, one line with the file and the place in it: no
  /// glTF 2.0, anything that check_gltf() rejects.
  static GltfFile open(const std::filesystem::path& path);
  /// As open(), from the bytes of the file. `path`: for messages and for the folder of other files.
  GltfFile(std::string_view bytes, std::filesystem::path path);

  const tinygltf::Model& model() const { return model_; }
  const std::filesystem::path& path() const { return path_; }

  /// Throws InputError: the file, and what is wrong with it.
  [[noreturn]] void fail(const std::string& what) const;
  /// Element of a list of the model. Throws InputError where there is none.
  template <class T>
  const T& of(const std::vector<T>& list, int index) const {
    if (index < 0 || static_cast<size_t>(index) >= list.size()) fail("is a damaged glTF");
    return list[static_cast<size_t>(index)];
  }

  /// The first `width` components of each element of an accessor, row by row; integers become 0 to
  /// 1, those with sign -1 to 1. `name` is what the accessor contains, `row` what one row of it is,
  /// for messages: sparse accessors and numbers beyond kMaxValue throw InputError.
  std::vector<float> numbers(int accessor, size_t width, const std::string& name,
                             const std::string& row = "vertex");
  /// As numbers(), for unsigned integers.
  std::vector<uint32_t> integers(int accessor, size_t width, const std::string& name);

 private:
  struct Rows {
    const tinygltf::Accessor* accessor = nullptr;
    size_t component_bytes = 0;
  };
  void load(std::string_view bytes);
  Rows open_rows(int accessor, size_t width, const std::string& name);
  const unsigned char* element(const tinygltf::Accessor& accessor, size_t n, size_t bytes) const;

  std::filesystem::path path_;
  tinygltf::Model model_;
  size_t rows_read_ = 0;
};

}  // namespace v3d
