#include "v3dctl/pending_mesh_file.h"

#include <unistd.h>

#include <stdexcept>

#include "v3dctl/host_name.h"

namespace v3d::ctl {

namespace fs = std::filesystem;

PendingMeshFile::PendingMeshFile(const fs::path& place)
    : place_(place),
      // Several hosts may share the disk.
      path_(place.string() + ".partial-" + host_name() + "-" + std::to_string(getpid())),
      file_(path_) {}

PendingMeshFile::~PendingMeshFile() {
  std::error_code ignored;
  if (!moved_) fs::remove(path_, ignored);
}

void PendingMeshFile::append(int64_t pulse, const std::vector<uint8_t>& compact) {
  if (!file_.append(pulse, compact)) refuse();
}

void PendingMeshFile::finish() {
  if (!file_.close()) refuse();
  fs::rename(path_, place_);
  moved_ = true;
}

void PendingMeshFile::refuse() const {
  throw std::runtime_error(path_.string() + ": cannot write: is the disk full?");
}

}  // namespace v3d::ctl
