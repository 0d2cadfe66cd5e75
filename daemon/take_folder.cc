#include "daemon/take_folder.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/error.h"
#include "base/name.h"
#include "take/verify.h"
#include "wire/messages.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// Runs file operations; their exceptions become the InputError of set-up.
template <class Operations>
void as_input_error(const fs::path& folder, Operations operations) {
  try {
    operations();
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {
    throw InputError("cannot make take " + folder.string() + ": " + error.what());
  }
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

void refuse_take_name(const std::string& take) {
  const std::string cannot = "'" + take + "' cannot name a take: ";
  if (!is_file_name(take)) throw InputError(cannot + std::string(kFileNameRule));
  for (const CommandVerb verb : {CommandVerb::kCheck, CommandVerb::kBackground}) {
    if (take != name(verb)) continue;
    throw InputError(cannot + "v3dctl " + take + " goes by this name; choose another");
  }
}

void refuse_bad_take(const Studio& studio, const std::string& take) {
  refuse_take_name(take);
  if (fs::exists(take_paths(studio, take).info())) {
    throw InputError("take " + take + " exists already in " + studio.storage.takes.string() +
                     "; choose another name");
  }
}

void create_take(const Studio& studio, const TakeInfo& info) {
  const TakePaths paths = take_paths(studio, info.name);
  as_input_error(paths.folder, [&] {
    fs::create_directories(paths.background());
    fs::copy_file(studio.storage.calib, paths.calib(), fs::copy_options::overwrite_existing);
    fs::copy_file(studio.path, paths.studio(), fs::copy_options::overwrite_existing);
    for (const std::string& camera : info.cameras) {
      for (const auto& entry : fs::directory_iterator(studio.storage.background)) {
        if (entry.path().filename().string().starts_with(camera + ".")) {
          fs::copy_file(entry.path(), paths.background() / entry.path().filename(),
                        fs::copy_options::overwrite_existing);
        }
      }
    }
    save_take_info(paths, info);
  });
}

bool close_take(const Studio& studio, TakeInfo info, const Ledger& ledger) {
  const TakePaths paths = take_paths(studio, info.name);
  info.pulses = ledger.commanded;
  info.state = TakeState::kComplete;
  try {
    save_ledger(paths.ledger(), ledger);
    save_take_info(paths, info);
    return true;
  } catch (const std::exception& error) {
    spdlog::error("take {}: {}", info.name, error.what());
    return false;
  }
}

std::vector<RecoveredTake> recover_open_takes(const Studio& studio,
                                              const std::vector<std::string>& cameras) {
  std::vector<RecoveredTake> takes;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(studio.storage.takes, error)) {
    const TakePaths paths{entry.path()};
    if (!fs::exists(paths.info(), error)) continue;
    try {
      if (!is_open_take_of(load_take_info(paths), cameras)) continue;
      Ledger ledger = recover_take(paths).ledger;
      takes.push_back({"recovered " + ledger.verdict(), std::move(ledger)});
    } catch (const std::exception& problem) {
      takes.push_back({"cannot recover " + entry.path().string() + ": " + problem.what(), {}});
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
