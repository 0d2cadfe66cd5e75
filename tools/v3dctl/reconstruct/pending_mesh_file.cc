#include "v3dctl/reconstruct/pending_mesh_file.h"

#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <csignal>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
#include "take/take_files.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

void sync_folder_of(const fs::path& path) {
  io::throw_if_failed(io::sync_folder(fs::absolute(path).parent_path()));
}

constexpr char kPartial[] = ".partial-";
constexpr take::ReadFrom kFromCache = take::ReadFrom::kPageCache;

/// A hidden name, because the file is no file of the take yet (take::take_file_names()).
fs::path partial_path(const fs::path& path) {
  return path.parent_path() / ("." + path.filename().string() + kPartial + process_suffix());
}

/// True when no other process can be writing this partial file: its process of this host has ended.
/// Of the processes of other hosts, nothing is known.
bool is_abandoned(const std::string& name, const std::string& prefix) {
  if (!name.starts_with(prefix)) return false;
  const std::string_view digits = std::string_view(name).substr(prefix.size());
  pid_t process = 0;
  const auto parsed = std::from_chars(digits.begin(), digits.end(), process);
  if (parsed.ec != std::errc() || parsed.ptr != digits.end() || process <= 0) return false;
  return process == getpid() || (kill(process, 0) != 0 && errno == ESRCH);
}

/// Removes the partial files of `path` that killed processes of this host left behind. Ignores
/// errors: such a file takes only space.
void remove_abandoned(const fs::path& path) {
  const std::string prefix = "." + path.filename().string() + kPartial + host_name() + "-";
  std::error_code ignored;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(fs::absolute(path).parent_path(), ignored)) {
    if (!is_abandoned(entry.path().filename(), prefix)) continue;
    fs::remove(entry.path(), ignored);
  }
}

/// Gives the tracked surfaces another name, which no command reads.
void keep_as_earlier_motion(const take::TakePaths& take) {
  for (int number = 1;; ++number) {
    const fs::path kept = take.earlier_motion(number);
    const io::Status renamed = io::rename_new(take.motion(), kept);
    if (!renamed && renamed.error().code == EEXIST) continue;
    io::throw_if_failed(renamed);
    note("renamed " + take.motion().string() + " to " + kept.filename().string() +
         ": it was tracked on the earlier meshes; v3dctl track " + take.folder.string() +
         " makes another");
    return;
  }
}

/// Requires that no other object of this process has the same path.
fs::path new_partial_path(const fs::path& path) {
  remove_abandoned(path);
  return partial_path(path);
}

/// Removes the file where its header cannot be written.
take::MeshFileWriter new_mesh_file(const fs::path& path) {
  try {
    return take::MeshFileWriter(path);
  } catch (...) {
    std::error_code ignored;
    fs::remove(path, ignored);
    throw;
  }
}

}  // namespace

std::string process_suffix() { return host_name() + "-" + std::to_string(getpid()); }

FileVersion::FileVersion(fs::path path) : path_(std::move(path)) {
  if (stat(path_.c_str(), &status_) != 0)
    io::throw_input_error(io::io_error("read", path_).value());
}

void FileVersion::require_unchanged() const {
  const auto facts = [](const struct stat& status) {
    return std::tuple(status.st_dev, status.st_ino, status.st_size, status.st_mtim.tv_sec,
                      status.st_mtim.tv_nsec);
  };
  if (facts(FileVersion(path_).status_) == facts(status_)) return;
  throw InputError(
      path_.string() +
      ": has changed meanwhile, and stays as it is: v3d-recond or another command writes "
      "it; repeat this command when the take has ended");
}

void require_finished(const take::MeshFileReader& meshes, const fs::path& path) {
  if (!meshes.index_was_rebuilt()) return;
  throw InputError(path.string() +
                   ": has no index: it is truncated or not finished; expected a whole file: repeat "
                   "this command when the take has ended, or run v3dctl reconstruct");
}

PendingMeshFile::PendingMeshFile(const fs::path& path)
    : path_(path), temporary_path_(new_partial_path(path)), file_(new_mesh_file(temporary_path_)) {}

PendingMeshFile::~PendingMeshFile() {
  std::error_code ignored;
  if (!finished_) fs::remove(temporary_path_, ignored);
}

void PendingMeshFile::append(int64_t pulse, const std::vector<uint8_t>& compact) {
  io::throw_if_failed(file_.append(pulse, compact));
}

void PendingMeshFile::append(int64_t pulse, const take::MeshRecord& record) {
  io::throw_if_failed(file_.append(pulse, record));
}

void PendingMeshFile::close() { io::throw_if_failed(file_.close()); }

bool PendingMeshFile::has_bytes_of_earlier() const {
  std::error_code error;  // the size is then that of no file
  if (fs::file_size(path_, error) != fs::file_size(temporary_path_, error)) return false;
  const take::TakePaths folder{path_.parent_path()};
  const auto made = take::read_take_file(folder, temporary_path_.filename(), kFromCache);
  const auto earlier = take::read_take_file(folder, path_.filename(), kFromCache);
  return made && earlier && made->checksum == earlier->checksum;
}

void PendingMeshFile::finish() {
  close();
  fs::rename(temporary_path_, path_);
  finished_ = true;
  sync_folder_of(path_);
}

void PendingMeshFile::finish(const FileVersion& source) {
  close();
  source.require_unchanged();
  finish();
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
  if (file_exists(take.motion()) && !meshes.master.has_bytes_of_earlier()) {
    keep_as_earlier_motion(take);
  }
  meshes.finish();
  if (had_proxy && !meshes.proxy) {
    note("removed " + take.proxy().string() +
         ", the proxy of the earlier meshes; --proxy LEN makes another");
  }
}

}  // namespace v3d::ctl
