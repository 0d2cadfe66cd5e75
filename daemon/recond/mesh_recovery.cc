#include "daemon/recond/mesh_recovery.h"

#include <stdexcept>

#include "base/core/text.h"
#include "daemon/node/service.h"
#include "take/logs/mesh_file.h"

namespace v3d::recond {
namespace {

io::Status add_index(const std::filesystem::path& mesh, const take::ReadProgress& progress) {
  return take::MeshFileWriter(mesh, take::LogOpening::kContinue, progress).close();
}

}  // namespace

RecoveredMeshes recover_mesh_file(const std::filesystem::path& mesh) {
  node::service::status("recovering the meshes of " + mesh.parent_path().filename().string());
  node::service::WorkProgress work;
  const auto progress = [&] { work.report(); };
  try {
    const take::MeshFileReader file(mesh, progress);
    const auto meshes = static_cast<int64_t>(file.pulses().size());
    const io::Status indexed = file.index_was_rebuilt() ? add_index(mesh, progress) : io::Status();
    return {.meshes = meshes,
            .is_whole = indexed.has_value(),
            .text = format_count(meshes) + " meshes recovered" +
                    (indexed ? "" : "; no index was added: " + indexed.error().message)};
  } catch (const std::runtime_error& error) {  // also of the disk
    return {.meshes = {},
            .is_whole = false,
            .text = "no meshes recovered: " + std::string(error.what())};
  }
}

}  // namespace v3d::recond
