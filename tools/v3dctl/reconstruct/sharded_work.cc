#include "v3dctl/reconstruct/sharded_work.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <stdexcept>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxTries = 3;

/// Last line of the newest task log, after its path; empty when no task wrote anything.
std::string last_log_line(const fs::path& folder) {
  fs::path newest;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path& path = entry.path();
    if (!path.filename().string().starts_with("task-") || fs::file_size(path) == 0) continue;
    if (newest.empty() || fs::last_write_time(path) > fs::last_write_time(newest)) newest = path;
  }
  if (newest.empty()) return {};
  std::string text = read_file(newest);
  text.erase(text.find_last_not_of('\n') + 1);
  return newest.string() + ": " + text.substr(text.rfind('\n') + 1);
}

}  // namespace

ShardedRun::ShardedRun(const TaskFolder& folder, TaskRunner& tasks, const std::string& command)
    : folder_(folder), tasks_(tasks), lock_(folder) {
  if (lock_.state() == ShardFolderLock::State::kHeldByAnother) {
    throw InputError(folder_.path().string() + ": another v3dctl " + command +
                     " already makes these shards");
  }
  if (!lock_.error().empty()) throw std::runtime_error(lock_.error());
}

void ShardedRun::make(ShardedWork& work) {
  try {
    make_missing(work);
  } catch (...) {
    if (folder_.saved_shards().empty() && !names_log_) folder_.remove();
    throw;
  }
}

void ShardedRun::make_missing(ShardedWork& work) {
  for (;;) {
    work.find_finished();
    const std::vector<take::FrameRange> missing = work.missing();
    if (missing.empty()) return;
    stop_after_too_many_tries(missing);
    run_tasks(work);
  }
}

void ShardedRun::run_tasks(ShardedWork& work) {
  started_.clear();
  start(work.missing(), work);
  while (tasks_.poll()) {
    stop_on_error_or_interrupt();
    if (!work.watch()) break;
    start(work.known_meanwhile(), work);
  }
  stop_on_error_or_interrupt();
  tasks_.cancel();
}

void ShardedRun::start(const std::vector<take::FrameRange>& shards, ShardedWork& work) {
  std::vector<take::FrameRange> waiting;
  for (const take::FrameRange& shard : shards) {
    const Key key{shard.begin, shard.end};
    if (!started_.insert(key).second) continue;
    ++tries_[key];
    waiting.push_back(shard);
  }
  if (!waiting.empty()) work.start(waiting, tasks_);
}

void ShardedRun::stop_on_error_or_interrupt() {
  const std::optional<std::string> error = folder_.saved_error();
  if (!error && !interrupted()) return;
  tasks_.cancel();
  if (error) throw InputError(*error);
  throw std::runtime_error("interrupted; repeat the command to continue after the finished shards");
}

void ShardedRun::stop_after_too_many_tries(const std::vector<take::FrameRange>& missing) {
  const auto failed = std::ranges::count_if(missing, [&](const take::FrameRange& shard) {
    const auto tries = tries_.find({shard.begin, shard.end});
    return tries != tries_.end() && tries->second >= kMaxTries;
  });
  if (failed == 0) return;
  throw std::runtime_error(count_of(failed, "shard") + " of the take failed " +
                           std::to_string(kMaxTries) + " times; " + reason_of_failure());
}

/// A task that a signal ends may have no time for a message, so both are named.
std::string ShardedRun::reason_of_failure() {
  const std::string log_line = last_log_line(folder_.path());
  names_log_ = !log_line.empty();
  std::string reason = tasks_.failure();
  if (names_log_) reason += (reason.empty() ? "" : "; ") + log_line;
  return reason.empty() ? "no task wrote a message" + tasks_.hint() : reason;
}

}  // namespace v3d::ctl
