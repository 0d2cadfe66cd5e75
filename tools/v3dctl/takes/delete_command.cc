// takes delete: the only command that deletes recordings.
#include <cstdio>

#include "base/core/error.h"
#include "base/core/printable.h"
#include "base/core/units.h"
#include "common/console.h"
#include "take/ledger/verified.h"
#include "take/take_copy.h"
#include "take/take_lock.h"
#include "take/take_removal.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

struct DeleteArguments {
  SharedTakesArguments takes;
  fs::path copy;
  bool no_copy = false;
  bool yes = false;
};

[[noreturn]] void refuse_unverified(const TakeListing& take) {
  throw InputError(take.info.name + " is not verified, or has changed since: v3dctl verify " +
                   take.paths.folder.string());
}

/// Throws InputError for a take that must not be deleted.
void require_deletable(const TakeListing& take) {
  const std::string& name = take.info.name;
  if (take.info.state == TakeState::kRecording) {
    throw InputError(name + " is being recorded, or was not closed: v3dctl verify --recover " +
                     take.paths.folder.string());
  }
  if (!take.examined) refuse_unverified(take);
  if (take.slate.mark == Mark::kCircled) {
    throw InputError(name + " is circled: v3dctl takes clear " + name);
  }
}

/// Reads the copy back from its disk. Throws InputError when it is incomplete, and reports the
/// missing files.
void require_copy(const TakeListing& take, const fs::path& copies) {
  const auto verified = load_verified(take.paths);
  if (!verified) refuse_unverified(take);
  const TakePaths copy{copies / take.info.name};
  const std::vector<std::string> missing = missing_in_copy(take.paths, *verified, copy);
  if (missing.empty()) return;
  for (const std::string& text : missing) note(text);
  throw InputError(take.info.name + " is not deleted: its copy in " + copies.string() +
                   " is incomplete; move " + copy.folder.string() +
                   " away, then v3dctl takes collect copies the take again");
}

std::vector<InterruptedDeletion> interrupted_in(const fs::path& folder) {
  return io::value_or_throw(interrupted_deletions(folder));
}

/// Finishes all interrupted deletions. They were requested with --yes.
void finish_deletions(const fs::path& folder) {
  for (const InterruptedDeletion& deletion : interrupted_in(folder)) {
    io::throw_if_failed(finish_deletion(deletion));
    std::printf("finished the deletion of %s\n", printable(deletion.take).c_str());
  }
}

/// `takes delete` without names.
int run_finish(const fs::path& folder, bool yes) {
  const std::vector<InterruptedDeletion> interrupted = interrupted_in(folder);
  if (interrupted.empty()) {
    throw InputError("takes delete: name the takes; " + folder.string() +
                     " has no interrupted deletion to finish");
  }
  if (!yes) {
    throw InputError(interrupted_text(interrupted) + "; add --yes to finish");
  }
  finish_deletions(folder);
  return kExitDone;
}

int run_delete(const CommandLine& line, const DeleteArguments& arguments) {
  const fs::path folder = takes_folder(line, *arguments.takes);
  if (arguments.takes->names.empty()) return run_finish(folder, arguments.yes);
  if (arguments.copy.empty() == !arguments.no_copy) {
    throw InputError(
        "takes delete: name the folder of the copies, which are read back first (--copy DIR), or "
        "say that none is needed (--no-copy)");
  }
  const std::vector<TakeListing> takes = named_takes(line, *arguments.takes);
  double bytes = 0;
  for (const TakeListing& take : takes) {
    require_deletable(take);
    bytes += static_cast<double>(take.bytes);
  }
  if (!arguments.yes) {
    for (const std::string& text : listing_lines(takes)) note(text);
    throw InputError(format_bytes(bytes) +
                     " would be deleted permanently; add --yes to delete them");
  }
  std::vector<std::vector<TakeLock>> locks;  // until all takes are deleted
  for (const TakeListing& take : takes) {
    locks.push_back(io::value_or_throw(lock_whole_take(take.paths)));
  }
  for (const TakeListing& take : takes) {
    if (!arguments.no_copy) require_copy(take, arguments.copy);
  }
  for (const TakeListing& take : takes) {
    io::throw_if_failed(delete_take(take.paths));
    std::printf("deleted %s\n", take.info.name.c_str());
  }
  finish_deletions(folder);
  return kExitDone;
}

}  // namespace

void add_takes_delete(CommandLine& line, CLI::App* takes, const SharedTakesArguments& shared) {
  CLI::App* command =
      add_takes_subcommand(takes, "delete", "Delete takes that are verified and not circled",
                           "v3dctl takes delete kendo-06 --copy /mnt/archive --yes");
  auto arguments = std::make_shared<DeleteArguments>();
  arguments->takes = shared;
  command->add_option("NAME", shared->names,
                      "Takes (none: finish deletions that were interrupted)");
  command
      ->add_option("--copy", arguments->copy,
                   "Folder of takes with the copies; each is read back from its disk and compared")
      ->type_name("DIR");
  command->add_flag("--no-copy", arguments->no_copy, "Delete takes without a copy");
  command->add_flag("--yes", arguments->yes,
                    "Delete; otherwise the command only lists what it would delete");
  line.on_run(command, [&line, arguments] { return run_delete(line, *arguments); });
}

}  // namespace v3d::ctl
