// A glTF 2.0 document in binary form while it is written: JSON and one buffer.
// Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/mesh.h"
#include "take/take_sound.h"
#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {

// Numbers of glTF.
inline constexpr int kArrayBuffer = 34962;
inline constexpr int kElementArrayBuffer = 34963;
inline constexpr int kUnsignedInt = 5125;
inline constexpr int kTriangles = 4;

/// Limit of a file, bytes.
inline constexpr uint64_t kMaxGlbBytes = UINT32_MAX;

/// One thread.
class GltfDocument {
 public:
  /// An empty scene.
  GltfDocument();

  nlohmann::json& gltf() { return gltf_; }
  /// Appends to a list of the document; returns the index.
  size_t add(const char* list, nlohmann::json item);
  /// A new buffer; the length of the first one is set by bytes(). Returns the index.
  size_t add_buffer();
  /// Appends to the first buffer; returns the offset, a multiple of 4.
  size_t append(std::span<const uint8_t> bytes);
  /// Appends a buffer view with these bytes to the first buffer; returns the index. `target`: 0 for
  /// none.
  size_t add_view(std::span<const uint8_t> bytes, int target = 0);
  /// An accessor with a view of its own of a vertex attribute; returns the index. A POSITION gets
  /// its bounds.
  size_t add_attribute(const VertexStream& stream, size_t vertices);
  /// The same for the vertices of triangles.
  size_t add_indices(const std::vector<uint32_t>& indices);
  /// The same for floats that are no vertex attribute, `width` (1, 3, 4 or 16) in each element;
  /// `bounded`: with minimum and maximum.
  size_t add_floats(const std::vector<float>& values, size_t width, bool bounded);
  /// Adds keys of a node to an animation, which is no part of the document yet: times in seconds,
  /// `width` values at each.
  void animate(nlohmann::json& animation, size_t node, const char* path, const char* interpolation,
               const std::vector<float>& times, const std::vector<float>& values, size_t width);
  /// A material that shows the vertex colours as they are, because they contain the light of the
  /// studio (KHR_materials_unlit); returns the index.
  size_t add_unlit_material();
  /// Gives a material of add_unlit_material() a texture: a JPEG file, which becomes part of the
  /// document. Vertices then need TEXCOORD_0 in place of colours.
  void set_texture(size_t material, std::span<const uint8_t> jpeg);

  /// Length of the first buffer so far.
  uint64_t buffer_bytes() const { return binary_.size(); }
  /// The whole file. Throws InputError when it would exceed kMaxGlbBytes.
  std::string bytes();

 private:
  nlohmann::json gltf_;
  std::string binary_;
};

/// Accessors without a view.
nlohmann::json accessor_of(const VertexStream& stream, size_t vertices);
nlohmann::json accessor_of_indices(size_t count);

/// Extras of a node for a pulse with timecode: `pulse`, `timecode` and `timecode_rate`.
nlohmann::json timecode_extras(int64_t pulse, const take::PulseTimecode& timecode);

/// The rotation of a node from z up to the y up of glTF, a quaternion x, y, z, w.
nlohmann::json y_up_rotation();

}  // namespace v3d::ctl
