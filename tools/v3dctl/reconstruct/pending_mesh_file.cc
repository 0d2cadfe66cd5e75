#include "v3dctl/reconstruct/pending_mesh_file.h"

#include <unistd.h>

#include "base/io/file.h"
#include "v3dctl/process.h"

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
  io::throw_if_failed(file_.append(pulse, compact));
}

void PendingMeshFile::finish() {
  io::throw_if_failed(file_.close());
  fs::rename(path_, place_);
  moved_ = true;
  io::throw_if_failed(io::sync_folder(fs::absolute(place_).parent_path()));
}

}  // namespace v3d::ctl
