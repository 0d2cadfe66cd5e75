#include "daemon/node/take_folder.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "daemon/control/take_name.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/service.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/take_removal.h"
#include "wire/messages.h"

namespace v3d::node {
namespace {

namespace fs = std::filesystem;

/// Copies the background plates of the take's cameras.
io::Status copy_plates(const Studio& studio, const take::TakeInfo& info, const fs::path& to) {
  const auto plates = io::list_folder(studio.storage.background);
  if (!plates) return tl::make_unexpected(plates.error());
  for (const std::string& camera : info.cameras) {
    for (const fs::path& plate : *plates) {
      if (!plate.filename().string().starts_with(camera + ".") || io::is_temporary(plate)) continue;
      if (auto copied = io::copy_file(plate, to / plate.filename()); !copied) return copied;
    }
  }
  return io::sync_folder(to);
}

io::Status write_take_files(const Studio& studio, const take::TakeInfo& info,
                            const take::TakePaths& paths) {
  io::Status status = io::create_folders(paths.background());
  if (status) status = io::copy_file(studio.storage.calib, paths.calib());
  if (status) status = io::copy_file(studio.path, paths.studio());
  if (status) status = copy_plates(studio, info, paths.background());
  if (status) status = save_take_info(paths, info);  // also syncs the folder
  return status;
}

/// Takes of hours are read for minutes.
take::Verification recover_with_progress(const take::TakePaths& paths) {
  service::WorkProgress progress;
  return recover_take(paths, take::AfterReadErrors::kStayOpen, [&] { progress.report(); });
}

/// Result of a recovery, for the daemon's log.
std::string summary_of(const take::Verification& found) {
  std::string line = "recovered " + found.ledger.verdict();
  for (const std::string& text : found.disagreements) {
    if (text.starts_with("cannot read")) line += "; " + text;
  }
  for (const std::string& text : found.notes) line += "; " + text;
  return line;
}

}  // namespace

take::TakePaths take_paths(const Studio& studio, const std::string& take) {
  return {studio.storage.takes / take};
}

void check_new_take(const Studio& studio, const std::string& take) {
  control::check_take_name(take);
  const take::TakePaths paths = take_paths(studio, take);
  if (io::value_or_throw(io::type_of(paths.info())) != fs::file_type::not_found ||
      io::value_or_throw(take::holds_logs(paths.folder))) {
    throw InputError("take " + take + " exists already in " + studio.storage.takes.string() +
                     "; choose another name");
  }
}

void create_take(const Studio& studio, const take::TakeInfo& info) {
  const take::TakePaths paths = take_paths(studio, info.name);
  const io::Status made = write_take_files(studio, info, paths);
  if (!made) {
    throw InputError("cannot create take " + paths.folder.string() + ": " + made.error().message);
  }
}

take::TakeInfo reopen_take(const take::TakePaths& paths) {
  take::TakeInfo info = load_take_info(paths);
  info.state = take::TakeState::kRecording;
  if (auto saved = save_take_info(paths, info); !saved) io::throw_input_error(saved.error());
  return info;
}

take::TakeLock lock_take(const take::TakePaths& paths, const std::string& node) {
  if (auto made = io::create_folders(paths.folder); !made) io::throw_input_error(made.error());
  take::TakeLock lock = io::value_or_throw(take::TakeLock::acquire(paths, node));
  if (!lock.excludes()) {
    spdlog::warn("{}: the file system has no locks; a second daemon of {} is not excluded",
                 paths.folder.string(), node);
  }
  return lock;
}

io::Result<std::vector<std::string>> close_take(const Studio& studio, take::TakeInfo info,
                                                const take::Ledger& ledger, take::TakeState state) {
  const take::TakePaths paths = take_paths(studio, info.name);
  info.pulses = ledger.commanded;
  info.state = state;
  service::WorkProgress progress;
  auto unread = save_account(paths, info, ledger, [&] { progress.report(); });
  if (unread) return unread;
  return tl::make_unexpected(io::IoError{
      .code = unread.error().code,
      .message = "cannot write the ledger of " + info.name + ": " + unread.error().message});
}

void quarantine_unarmed_take(const take::TakePaths& paths) {
  const auto holder = take_lock_holder(paths);
  if (!holder || !holder->empty()) return;  // another node may record into the same folder
  const auto moved_to = quarantine_take(paths);
  if (moved_to) {
    spdlog::warn("{} could not be armed: moved to {}", paths.folder.string(), moved_to->string());
  } else {
    spdlog::error("{} could not be armed, and {}", paths.folder.string(), moved_to.error().message);
  }
}

bool is_open_take_of(const take::TakeInfo& info, const std::vector<std::string>& cameras,
                     bool has_command) {
  if (info.state != take::TakeState::kRecording) return false;
  const auto is_own = [&](const std::string& camera) {
    return std::ranges::find(cameras, camera) != cameras.end();
  };
  const bool has_no_cameras = info.cameras.empty() && cameras.empty();
  return has_command || has_no_cameras || std::ranges::any_of(info.cameras, is_own);
}

std::vector<RecoveredTake> recover_open_takes(const Studio& studio, const std::string& node,
                                              const std::vector<std::string>& cameras) {
  std::vector<RecoveredTake> takes;
  if (io::type_of(studio.storage.takes) == fs::file_type::not_found) return takes;
  const auto folders = take::list_take_folders(studio.storage.takes);
  if (!folders) takes.push_back({"cannot search for open takes: " + folders.error().message, {}});
  for (const fs::path& folder : folders.value_or(std::vector<fs::path>())) {
    const take::TakePaths paths{folder};
    try {
      if (io::value_or_throw(io::type_of(paths.info())) == fs::file_type::not_found) {
        if (!io::value_or_throw(take::holds_logs(folder))) continue;
        throw InputError(take::missing_info_text(folder));
      }
      const bool has_command = io::value_or_throw(has_persisted_command(paths, node));
      if (!is_open_take_of(load_take_info(paths), cameras, has_command)) continue;
      const take::TakeLock lock = lock_take(paths, node);
      service::status("recovering " + folder.filename().string());
      take::Verification found = recover_with_progress(paths);
      if (found.read_errors.empty()) {
        takes.push_back({summary_of(found), std::move(found.ledger)});
      } else {
        takes.push_back({"take " + found.info.name + " stays open, the next start tries again: " +
                             found.read_errors.front(),
                         {}});
      }
    } catch (const std::exception& problem) {
      takes.push_back({"cannot recover " + folder.string() + ": " + problem.what(), {}});
    }
  }
  return takes;
}

io::Result<double> disk_free_bytes(const Studio& studio) {
  return io::free_bytes(studio.storage.takes).map([](uint64_t bytes) {
    return static_cast<double>(bytes);
  });
}

void report_free_space(const io::Result<double>& free_bytes, wire::HealthMessage& health) {
  if (free_bytes) {
    health.values["disk_free_bytes"] = *free_bytes;
  } else if (health.text.empty()) {
    health.text = free_bytes.error().message;
  }
}

namespace {

/// The owner that the lock file names.
std::string owner_in(int file) {
  std::array<char, 128> text{};
  const ssize_t size = pread(file, text.data(), text.size(), 0);
  return size > 0 ? printable(std::string(text.data(), static_cast<size_t>(size)))
                  : "another daemon";
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder, const std::string& name,
                       const std::string& owner) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);  // open() reports the error
  const std::filesystem::path path = folder / name;
  file_.reset(io::uninterrupted(
      [&] { return open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640); }));
  if (!file_) throw InputError(errno_message(path.string()));
  if (io::uninterrupted([&] { return flock(file_.get(), LOCK_EX | LOCK_NB); }) != 0) {
    if (errno != EWOULDBLOCK) throw InputError(errno_message("cannot lock " + path.string()));
    throw InputError(folder.string() + ": " + owner_in(file_.get()) +
                     " writes its takes here already; every reconstruction node needs a "
                     "takes folder of its own ([storage] takes)");
  }
  const bool written =
      ftruncate(file_.get(), 0) == 0 &&
      pwrite(file_.get(), owner.data(), owner.size(), 0) == static_cast<ssize_t>(owner.size());
  static_cast<void>(written);  // only used in a message; a full disk is reported elsewhere
}

}  // namespace v3d::node
