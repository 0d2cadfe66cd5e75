// Fuzz target: glTF 2.0 files with a skinned body. parse_performer() throws only InputError, and an
// accepted body has finite vertices and joints at its first key.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/core/error.h"
#include "v3d-sim/performer_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const auto model = v3d::sim::parse_performer({reinterpret_cast<const char*>(data), size},
                                                 "/nowhere/fuzz.glb", "");
    for (const v3d::sim::Part& part : model->parts_at(0)) {
      for (const Eigen::Vector3f& vertex : part.mesh.vertices) {
        if (!vertex.allFinite()) std::abort();
      }
    }
    for (const Eigen::Vector3d& joint : model->joint_positions(0)) {
      if (!joint.allFinite()) std::abort();
    }
    model->parts_at(-3.1);
    for (const v3d::sim::JointDefinition& joint : model->joints()) {
      if (joint.parent >= static_cast<int>(model->joints().size())) std::abort();
    }
  } catch (const v3d::InputError&) {
  }
  return 0;
}
