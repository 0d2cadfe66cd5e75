#include "take/take_deletion.h"

#include <cerrno>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "take/joined_slate.h"
#include "take/ledger/take_account.h"
#include "take/take_removal.h"
#include "take/take_transfer.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void reject_unverified(const std::string& name, const TakePaths& paths) {
  throw InputError(name + " is not verified, or has changed since: v3dctl verify " +
                   paths.folder.string());
}

/// True where this process may only read, so that it cannot create a lock file.
bool is_read_only(const io::IoError& error) {
  return error.code == EROFS || error.code == EACCES || error.code == EPERM || error.code == ENOENT;
}

/// Locks the copy against recording and recovery. Where lock files cannot be created, requires that
/// no process holds a lock. Throws InputError when another process does.
std::vector<TakeLock> lock_copy(const TakePaths& copy) {
  auto locks = lock_whole_take(copy);
  if (locks) return *std::move(locks);
  if (!is_read_only(locks.error())) io::throw_input_error(locks.error());
  const std::string holder = io::value_or_throw(take_lock_holder(copy));
  if (holder.empty()) return {};
  throw InputError(copy.folder.string() + ": " + holder + " has locked it");
}

/// People and commands replace these files of a copy at any time: slates and skeletons.
bool may_change(const std::string& name) {
  return name == TakePaths().slate() || is_skeleton(name);
}

}  // namespace

void require_deletable(const TakeListing& take) {
  const std::string& name = take.info.name;
  if (take.info.state == TakeState::kRecording) {
    throw InputError(name + " is being recorded, or was not closed: v3dctl verify --recover " +
                     take.paths.folder.string());
  }
  if (!take.examined) reject_unverified(name, take.paths);
  if (take.slate.mark == Mark::kCircled) {
    throw InputError(name + " is circled: v3dctl takes clear " + name);
  }
  if (const io::Status removable = check_removable(take.paths); !removable) {
    io::throw_input_error(removable.error());
  }
}

TakeDeletion::TakeDeletion(std::vector<TakePaths> takes, fs::path copies)
    : takes_(std::move(takes)), copies_(std::move(copies)) {
  // The locks of the takes come first: of two processes that delete each other's copy, one at least
  // finds the lock of the other.
  lock_takes();
  if (!copies_.empty()) lock_copies();
  for (const TakePaths& take : takes_) require_deletable(read_take_listing(take));
}

TakePaths TakeDeletion::copy_of(const TakePaths& take) const {
  return {copies_ / load_take_info(take).name};
}

void TakeDeletion::lock_take(const TakePaths& take) {
  auto lock = DeletionLock::acquire(take);
  // A take that needs no copy can be deleted to make room.
  if (!lock && copies_.empty() && is_of_full_disk(lock.error())) return;
  if (lock && !lock->excludes() && !copies_.empty()) {
    throw InputError(take.folder.string() +
                     " is not deleted: this user may not write the file .deletion in it, without "
                     "which its copy might be the take itself through another mount");
  }
  deletion_locks_.push_back(io::value_or_throw(std::move(lock)));
}

void TakeDeletion::lock_takes() {
  for (const TakePaths& take : takes_) {
    lock_take(take);
    take_locks_.push_back(io::value_or_throw(lock_whole_take(take)));
  }
}

void TakeDeletion::lock_copies() {
  for (const TakePaths& take : takes_) {
    const TakePaths copy = copy_of(take);
    if (!file_exists(copy.info())) {
      throw InputError(take.folder.string() + " is not deleted: " + copies_.string() +
                       " has no copy of it");
    }
    auto lock = DeletionLock::acquire(copy);
    if (!lock && lock.error().code == EDEADLK) {
      throw InputError(take.folder.string() + " is not deleted: " + copy.folder.string() +
                       " is the take itself by another path, not a copy");
    }
    deletion_locks_.push_back(io::value_or_throw(std::move(lock)));
    take_locks_.push_back(lock_copy(copy));
  }
}

TakeDeletion::Compared TakeDeletion::state_of(const TakePaths& take) const {
  auto verified = load_verified(take);
  if (!verified) reject_unverified(load_take_info(take).name, take);
  Compared state{.files = std::move(verified->files), .copy = {}};
  const TakePaths copy = copy_of(take);
  std::erase_if(state.files, [](const TakeFile& file) { return may_change(file.name); });
  for (const TakeFile& file : state.files) {
    const auto there = stat_take_file(copy, file.name);
    const bool is_absent =
        !there && (there.error().code == ENOENT || there.error().code == ENOTDIR);
    if (!there && !is_absent) io::throw_input_error(there.error());
    state.copy.push_back(there ? std::optional(*there) : std::nullopt);
  }
  return state;
}

void TakeDeletion::require_slate_in_copy(const TakePaths& take) const {
  const TakePaths copy = copy_of(take);
  const std::string text = text_not_in(load_slate(copy.slate()), load_slate(take.slate()));
  if (text.empty()) return;
  const std::string name = load_take_info(take).name;
  throw InputError(name + " is not deleted: the slate of its copy in " + copies_.string() +
                   " lacks \"" + text + "\"; write it there, or remove it here (v3dctl takes " +
                   "slate, clear)");
}

void TakeDeletion::compare(const std::function<void(const std::string&)>& report) {
  if (copies_.empty()) return;
  for (const TakePaths& take : takes_) require_slate_in_copy(take);  // before hours of reading
  for (const TakePaths& take : takes_) {
    const std::string name = load_take_info(take).name;
    const auto verified = load_verified(take);
    if (!verified) reject_unverified(name, take);
    compared_[take.folder] = state_of(take);  // before the copy is read
    const TakePaths copy = copy_of(take);
    const std::vector<std::string> missing = missing_in_copy(take, *verified, copy);
    if (missing.empty()) continue;
    for (const std::string& line : missing) report(line);
    throw InputError(name + " is not deleted: its copy in " + copies_.string() +
                     " is incomplete; move " + copy.folder.string() +
                     " away, then v3dctl takes collect copies the take again");
  }
}

void TakeDeletion::remove(const TakePaths& take) {
  require_deletable(read_take_listing(take));
  if (!copies_.empty() && state_of(take) != compared_.at(take.folder)) {
    throw InputError(load_take_info(take).name + " is not deleted: it or its copy in " +
                     copies_.string() +
                     " has changed since they were compared; repeat the command");
  }
  if (!copies_.empty()) require_slate_in_copy(take);
  io::throw_if_failed(delete_take(take));
}

}  // namespace v3d::take
