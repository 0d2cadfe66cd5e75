#include "v3dctl/reconstruct/task_folder.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>

#include <cerrno>
#include <chrono>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
#include "take/logs/log_files.h"
#include "take/take.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::string_view kShardPrefix = "shard-", kSamplesEnd = ".json";

std::span<const uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

std::string hex(uint64_t value) { return fmt::format("{:016x}", value); }

std::string checksum_of(std::initializer_list<std::span<const uint8_t>> parts) {
  return hex(v3d::checksum(parts));
}

/// Version and checksum of this program: another build may produce other bytes.
std::string program_id() {
  return V3D_VERSION " " + checksum_of({bytes_of(read_file("/proc/self/exe"))});
}

std::vector<fs::path> entries_of(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> entries;
  std::error_code gone;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, gone)) {
    if (entry.path().filename().string().starts_with(prefix)) entries.push_back(entry.path());
  }
  return entries;
}

/// ".shards-" of ".shards-0123", ".shards-track-" of ".shards-track-0123".
std::string prefix_of(const fs::path& folder) {
  const std::string name = folder.filename();
  return name.substr(0, name.rfind('-') + 1);
}

/// Checksum of the content of `files` and of `samples`.
std::string checksum_of(std::span<const fs::path> files, const Json& samples) {
  RunningChecksum sum;
  for (const fs::path& file : files) sum.add(bytes_of(read_file(file)));
  sum.add(bytes_of(samples.dump()));
  return hex(sum.value());
}

}  // namespace

Json input_state(const fs::path& path, const fs::path& folder) {
  std::error_code absent;
  const uintmax_t bytes = fs::file_size(path, absent);
  if (absent) return {path.lexically_relative(folder).string(), nullptr};
  const auto changed = fs::last_write_time(path).time_since_epoch();
  return {path.lexically_relative(folder).string(), bytes,
          std::chrono::duration_cast<std::chrono::nanoseconds>(changed).count()};
}

Json input_states(const recorded::TakeFrames& take) {
  const take::TakePaths& paths = take.paths();
  Json list = Json::array();
  const auto add = [&](const fs::path& path) { list.push_back(input_state(path, paths.folder)); };
  const auto add_log = [&](const fs::path& log) {
    for (const fs::path& segment : io::value_or_throw(take::existing_segments(log))) {
      add(segment);
      add(take::segment_index_path(segment));
    }
  };
  for (const fs::path& path : {paths.info(), paths.calib()}) add(path);
  add_log(paths.pulses());
  for (const RigCamera& camera : take.rig()) {
    add_log(paths.frames(camera.name));
    for (const char* end : {".mean.png", ".spread.png", ".toml"}) {
      add(paths.background() / (camera.name + end));
    }
  }
  return list;
}

TaskFolder TaskFolder::create(const fs::path& parent, const std::string& prefix,
                              const Json& request, const Json& inputs) {
  const Json content = {{"program", program_id()}, {"request", request}, {"inputs", inputs}};
  const std::string text = content.dump(1);
  TaskFolder folder(fs::canonical(parent) / (prefix + checksum_of({bytes_of(text)})));
  std::error_code error;
  fs::create_directory(folder.path(), error);
  if (error) throw std::runtime_error(folder.path().string() + ": " + error.message());
  replace_file(folder.path() / "request.json", text);
  return folder;
}

std::string TaskFolder::digest() const {
  const std::string name = path_.filename();
  return name.substr(name.rfind('-') + 1);
}

Json TaskFolder::saved_request() const {
  const fs::path path = path_ / "request.json";
  try {
    const Json content = Json::parse(read_file(path));
    if (content.at("program") != program_id()) {
      throw InputError(host_name() + " has another build of v3dctl than the one that created " +
                       path_.string() + ": install the same version on all nodes");
    }
    return content.at("request");
  } catch (const Json::exception&) {
    throw InputError(path.string() + ": is no request of v3dctl");
  }
}

fs::path TaskFolder::shard_file(const std::string& shard, std::string_view end) const {
  return path_ / (std::string(kShardPrefix) + shard + std::string(end));
}

void TaskFolder::save_samples(const std::string& shard, std::span<const fs::path> files,
                              const Json& samples) const {
  try {
    const std::string sum = checksum_of(files, samples);
    replace_file(shard_file(shard, kSamplesEnd),
                 Json{{"checksum", sum}, {"samples", samples}}.dump());
  } catch (const InputError& error) {
    throw std::runtime_error(error.what());  // no fault of the input: a retry may succeed
  }
}

std::optional<Json> TaskFolder::find_samples(const std::string& shard,
                                             std::span<const fs::path> files) const {
  const fs::path path = shard_file(shard, kSamplesEnd);
  if (!fs::exists(path)) return std::nullopt;
  for (const fs::path& file : files) {
    if (!fs::exists(file)) return std::nullopt;
  }
  try {
    const Json json = Json::parse(read_file(path));
    const Json& samples = json.at("samples");
    if (json.at("checksum") != checksum_of(files, samples)) return std::nullopt;
    return samples;
  } catch (const Json::exception&) {
    return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void TaskFolder::drop(const std::string& shard, std::span<const fs::path> files) const {
  std::error_code absent;
  fs::remove(shard_file(shard, kSamplesEnd), absent);
  for (const fs::path& file : files) fs::remove(file, absent);
}

std::vector<std::string> TaskFolder::saved_shards() const {
  std::vector<std::string> names;
  for (const fs::path& path : entries_of(path_, std::string(kShardPrefix))) {
    if (path.extension() != kSamplesEnd) continue;
    names.push_back(path.stem().string().substr(kShardPrefix.size()));
  }
  return names;
}

void TaskFolder::save_error(const std::string& reason) const {
  replace_file(path_ / ("error-" + process_suffix()), reason);
}

std::optional<std::string> TaskFolder::saved_error() const {
  for (const fs::path& path : entries_of(path_, "error-")) {
    if (!io::is_temporary(path)) return read_file(path);
  }
  return std::nullopt;
}

void TaskFolder::remove_messages() const {
  std::error_code ignored;
  for (const char* prefix : {"error-", "task-"}) {
    for (const fs::path& path : entries_of(path_, prefix)) fs::remove(path, ignored);
  }
}

void TaskFolder::remove() const {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void TaskFolder::remove_others() const {
  for (const fs::path& path : entries_of(path_.parent_path(), prefix_of(path_))) {
    if (path == path_ || prefix_of(path) != prefix_of(path_)) continue;
    const TaskFolder other(path);
    if (ShardFolderLock(other).state() == ShardFolderLock::State::kHeld) other.remove();
  }
}

ShardFolderLock::ShardFolderLock(const TaskFolder& folder) {
  const fs::path path = folder.path() / "lock";
  fd_.reset(
      io::uninterrupted([&] { return ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644); }));
  if (!fd_) {
    error_ = errno_message(path.string());
  } else if (io::uninterrupted([&] { return flock(fd_.get(), LOCK_EX | LOCK_NB); }) == 0) {
    state_ = State::kHeld;
  } else if (errno == EWOULDBLOCK) {
    state_ = State::kHeldByAnother;
  }
}

}  // namespace v3d::ctl
