// Fuzz target: glTF 2.0 models. parse_model() throws only InputError, and all vertices of an
// accepted model are finite.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/core/error.h"
#include "v3dctl/scene/model.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const auto model =
        v3d::ctl::parse_model({reinterpret_cast<const char*>(data), size}, "/nowhere/fuzz.gltf");
    const v3d::Mesh mesh = v3d::ctl::lit_model(model, Eigen::Affine3d::Identity());
    for (const Eigen::Vector3f& vertex : mesh.vertices) {
      if (!vertex.allFinite()) std::abort();
    }
  } catch (const v3d::InputError&) {
  }
  return 0;
}
