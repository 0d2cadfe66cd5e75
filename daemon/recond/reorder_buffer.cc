#include "daemon/recond/reorder_buffer.h"

namespace v3d {

bool ReorderBuffer::add(MeshMessage mesh) {
  if (has(mesh.pulse)) return false;
  bytes_ += mesh.compact.size();
  const int64_t pulse = mesh.pulse;
  waiting_.emplace(pulse, std::move(mesh));
  return true;
}

std::optional<MeshMessage> ReorderBuffer::take() {
  const auto found = waiting_.find(next_);
  if (found == waiting_.end()) return std::nullopt;
  std::optional<MeshMessage> mesh(std::move(found->second));
  waiting_.erase(found);
  bytes_ -= mesh->compact.size();
  ++next_;
  return mesh;
}

}  // namespace v3d
