#include "v3dctl/reconstruct/pending_mesh_file.h"

#include <unistd.h>

#include <system_error>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

void sync_folder_of(const fs::path& path) {
  io::throw_if_failed(io::sync_folder(fs::absolute(path).parent_path()));
}

}  // namespace

std::string process_suffix() { return host_name() + "-" + std::to_string(getpid()); }

PendingMeshFile::PendingMeshFile(const fs::path& path)
    : path_(path),
      temporary_path_(path.string() + ".partial-" + process_suffix()),
      file_(temporary_path_) {}

PendingMeshFile::~PendingMeshFile() {
  std::error_code ignored;
  if (!finished_) fs::remove(temporary_path_, ignored);
}

void PendingMeshFile::append(int64_t pulse, const std::vector<uint8_t>& compact) {
  io::throw_if_failed(file_.append(pulse, compact));
}

void PendingMeshFile::close() { io::throw_if_failed(file_.close()); }

void PendingMeshFile::finish() {
  close();
  fs::rename(temporary_path_, path_);
  finished_ = true;
  sync_folder_of(path_);
}

PendingMeshes::PendingMeshes(const fs::path& master_path, const std::optional<fs::path>& proxy_path)
    : master(master_path) {
  if (proxy_path) proxy.emplace(*proxy_path);
}

void PendingMeshes::finish() {
  master.close();
  if (proxy) proxy->close();
  master.finish();
  if (proxy) proxy->finish();
}

void replace_meshes(PendingMeshes& meshes, const take::TakePaths& take) {
  meshes.master.close();
  if (meshes.proxy) meshes.proxy->close();
  std::error_code error;
  const bool had_proxy = fs::remove(take.proxy(), error);
  if (error) throw fs::filesystem_error("cannot remove", take.proxy(), error);
  if (had_proxy) sync_folder_of(take.proxy());
  meshes.finish();
  if (had_proxy && !meshes.proxy) {
    note("removed " + take.proxy().string() +
         ", the proxy of the earlier meshes; --proxy LEN makes another");
  }
}

}  // namespace v3d::ctl
