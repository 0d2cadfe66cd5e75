#include "daemon/node/take_folder.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/core/error.h"
#include "base/core/name.h"
#include "base/io/file.h"
#include "take/ledger/take_account.h"
#include "take/ledger/verify.h"
#include "take/take_removal.h"
#include "wire/messages.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// Copies the background plates of the take's cameras.
io::Status copy_plates(const Studio& studio, const TakeInfo& info, const fs::path& to) {
  const auto plates = io::list_folder(studio.storage.background);
  if (!plates) return tl::make_unexpected(plates.error());
  for (const std::string& camera : info.cameras) {
    for (const fs::path& plate : *plates) {
      if (!plate.filename().string().starts_with(camera + ".")) continue;
      if (auto copied = io::copy_file(plate, to / plate.filename()); !copied) return copied;
    }
  }
  return io::sync_folder(to);
}

io::Status write_take_files(const Studio& studio, const TakeInfo& info, const TakePaths& paths) {
  io::Status status = io::create_folders(paths.background());
  if (status) status = io::copy_file(studio.storage.calib, paths.calib());
  if (status) status = io::copy_file(studio.path, paths.studio());
  if (status) status = copy_plates(studio, info, paths.background());
  if (status) status = save_take_info(paths, info);  // also syncs the folder
  return status;
}

bool holds_logs(const TakePaths& paths) {
  if (io::type_of(paths.folder) == fs::file_type::not_found) return false;
  const auto entries = io::list_folder(paths.folder);
  return !entries || std::ranges::any_of(*entries, [](const fs::path& entry) {
    return entry.extension() == ".lcmlog";
  });
}

/// Result of a recovery, for the daemon's log.
std::string summary_of(const Verification& found) {
  std::string line = "recovered " + found.ledger.verdict();
  for (const std::string& text : found.disagreements) {
    if (text.starts_with("cannot read")) line += "; " + text;
  }
  return line;
}

bool is_open_take_of(const TakeInfo& info, const std::vector<std::string>& cameras) {
  const auto is_ours = [&](const std::string& camera) {
    return std::find(cameras.begin(), cameras.end(), camera) != cameras.end();
  };
  return info.state == TakeState::kRecording &&
         std::any_of(info.cameras.begin(), info.cameras.end(), is_ours);
}

}  // namespace

TakePaths take_paths(const Studio& studio, const std::string& take) {
  return {studio.storage.takes / take};
}

void check_take_name(const std::string& take) {
  const std::string cannot = "'" + take + "' cannot name a take: ";
  if (!is_file_name(take)) throw InputError(cannot + std::string(kFileNameRule));
  for (const CommandVerb verb : {CommandVerb::kCheck, CommandVerb::kBackground}) {
    if (take != name(verb)) continue;
    throw InputError(cannot + "the name is reserved for v3dctl " + take + "; choose another");
  }
  if (take == kQuarantineFolder) {
    throw InputError(cannot +
                     "the name is reserved for the quarantine of empty takes; choose another");
  }
}

void check_new_take(const Studio& studio, const std::string& take) {
  check_take_name(take);
  const TakePaths paths = take_paths(studio, take);
  if (io::value_or_throw(io::type_of(paths.info())) != fs::file_type::not_found ||
      holds_logs(paths)) {
    throw InputError("take " + take + " exists already in " + studio.storage.takes.string() +
                     "; choose another name");
  }
}

void create_take(const Studio& studio, const TakeInfo& info) {
  const TakePaths paths = take_paths(studio, info.name);
  const io::Status made = write_take_files(studio, info, paths);
  if (!made) {
    throw InputError("cannot create take " + paths.folder.string() + ": " + made.error().message);
  }
}

TakeInfo reopen_take(const TakePaths& paths) {
  TakeInfo info = load_take_info(paths);
  info.state = TakeState::kRecording;
  if (auto saved = save_take_info(paths, info); !saved) io::throw_input_error(saved.error());
  return info;
}

TakeLock lock_take(const TakePaths& paths, const std::string& node) {
  if (auto made = io::create_folders(paths.folder); !made) io::throw_input_error(made.error());
  TakeLock lock = io::value_or_throw(TakeLock::acquire(paths, node));
  if (!lock.excludes()) {
    spdlog::warn("{}: the file system has no locks; a second daemon of {} is not excluded",
                 paths.folder.string(), node);
  }
  return lock;
}

void recover_reopened_take(const TakePaths& paths, const std::string& node) {
  try {
    const TakeLock lock = lock_take(paths, node);
    recover_take(paths);
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
  }
}

bool close_take(const Studio& studio, TakeInfo info, const Ledger& ledger) {
  const TakePaths paths = take_paths(studio, info.name);
  info.pulses = ledger.commanded;
  info.state = TakeState::kComplete;
  const auto unsummed = save_account(paths, info, ledger);
  if (!unsummed) spdlog::error("take {}: {}", info.name, unsummed.error().message);
  for (const std::string& line : unsummed.value_or(std::vector<std::string>())) {
    spdlog::error("take {}: its ledger lacks a checksum: {}", info.name, line);
  }
  return unsummed && unsummed->empty();
}

std::vector<RecoveredTake> recover_open_takes(const Studio& studio, const std::string& node,
                                              const std::vector<std::string>& cameras) {
  std::vector<RecoveredTake> takes;
  if (io::type_of(studio.storage.takes) == fs::file_type::not_found) return takes;
  const auto folders = io::list_folder(studio.storage.takes);
  if (!folders) takes.push_back({"cannot search for open takes: " + folders.error().message, {}});
  for (const fs::path& folder : folders.value_or(std::vector<fs::path>())) {
    const TakePaths paths{folder};
    try {
      if (io::value_or_throw(io::type_of(paths.info())) == fs::file_type::not_found) continue;
      if (!is_open_take_of(load_take_info(paths), cameras)) continue;
      const TakeLock lock = lock_take(paths, node);
      Verification found = recover_take(paths);
      takes.push_back({summary_of(found), std::move(found.ledger)});
    } catch (const std::exception& problem) {
      takes.push_back({"cannot recover " + folder.string() + ": " + problem.what(), {}});
    }
  }
  return takes;
}

double disk_free_bytes(const Studio& studio) {
  std::error_code error;
  const fs::space_info space = fs::space(studio.storage.takes, error);
  return error ? 0 : static_cast<double>(space.available);
}

}  // namespace v3d
