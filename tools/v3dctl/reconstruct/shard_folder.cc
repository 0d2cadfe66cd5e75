#include "v3dctl/reconstruct/shard_folder.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>

#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "codec/frame_codec.h"
#include "common/console.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file.h"
#include "v3dctl/reconstruct/pending_mesh_file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kPrefix[] = ".shards-";

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

/// Identifies an input file by size and time, because reading recordings would take too long.
Json input(const fs::path& path, const fs::path& folder) {
  std::error_code absent;
  const uintmax_t bytes = fs::file_size(path, absent);
  if (absent) return {path.lexically_relative(folder).string(), nullptr};
  const auto changed = fs::last_write_time(path).time_since_epoch();
  return {path.lexically_relative(folder).string(), bytes,
          std::chrono::duration_cast<std::chrono::nanoseconds>(changed).count()};
}

Json inputs_of(const recorded::TakeFrames& take) {
  const take::TakePaths& paths = take.paths();
  Json list = Json::array();
  const auto add = [&](const fs::path& path) { list.push_back(input(path, paths.folder)); };
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

std::string name_of(const Shard& shard, const char* end) {
  return fmt::format("shard-{:06}{}", shard.number, end);
}

std::vector<fs::path> entries_of(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> entries;
  std::error_code gone;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, gone)) {
    if (entry.path().filename().string().starts_with(prefix)) entries.push_back(entry.path());
  }
  return entries;
}

}  // namespace

std::vector<Shard> shards_of(const std::vector<int64_t>& pulses) {
  const int64_t length = codec::EncoderOptions().key_every;
  std::vector<Shard> shards;
  for (const int64_t pulse : pulses) {
    if (shards.empty() || shards.back().number != pulse / length) {
      shards.push_back({pulse / length, {}});
    }
    shards.back().pulses.push_back(pulse);
  }
  return shards;
}

std::vector<int64_t> pulses_with_meshes(const Shard& shard, const ReconstructReport& report) {
  std::vector<int64_t> pulses = shard.pulses;
  for (const auto& [oversized, reason] : report.oversized) std::erase(pulses, oversized);
  return pulses;
}

ShardFolder ShardFolder::create(const ReconstructRequest& complete,
                                const recorded::TakeFrames& take) {
  const Json content = {{"program", program_id()},
                        {"request", request_to_json(complete)},
                        {"inputs", inputs_of(take)}};
  const std::string text = content.dump(1);
  const fs::path take_folder = fs::canonical(take.paths().folder);
  ShardFolder folder(take_folder / (kPrefix + checksum_of({bytes_of(text)})));
  std::error_code error;
  fs::create_directory(folder.path(), error);
  if (error) throw std::runtime_error(folder.path().string() + ": " + error.message());
  replace_file(folder.path() / "request.json", text);
  return folder;
}

std::string ShardFolder::digest() const {
  return path_.filename().string().substr(sizeof kPrefix - 1);
}

ReconstructRequest ShardFolder::request() const {
  const fs::path path = path_ / "request.json";
  try {
    const Json content = Json::parse(read_file(path));
    if (content.at("program") != program_id()) {
      throw InputError(host_name() + " has another build of v3dctl than the one that created " +
                       path_.string() + ": install the same version on all nodes");
    }
    ReconstructRequest request = request_from_json(content.at("request"));
    request.take = path_.parent_path();
    return request;
  } catch (const Json::exception&) {
    throw InputError(path.string() + ": is no request of v3dctl reconstruct");
  }
}

fs::path ShardFolder::mesh(const Shard& shard) const { return path_ / name_of(shard, ".v3d"); }
fs::path ShardFolder::proxy(const Shard& shard) const {
  return path_ / name_of(shard, ".proxy.v3d");
}
fs::path ShardFolder::report(const Shard& shard) const { return path_ / name_of(shard, ".json"); }

void ShardFolder::save(const Shard& shard, const ReconstructReport& report) const {
  const Json samples = samples_to_json(report);
  try {
    const std::string sum = checksum(shard, samples, !report.proxy.empty());
    replace_file(this->report(shard), Json{{"checksum", sum}, {"samples", samples}}.dump());
  } catch (const InputError& error) {
    throw std::runtime_error(error.what());  // no fault of the input: a retry may succeed
  }
}

std::string ShardFolder::checksum(const Shard& shard, const Json& samples, bool with_proxy) const {
  const std::string text = samples.dump(), meshes = read_file(mesh(shard));
  const std::string proxies = with_proxy ? read_file(proxy(shard)) : "";
  return checksum_of({bytes_of(meshes), bytes_of(proxies), bytes_of(text)});
}

std::optional<ReconstructReport> ShardFolder::find(const Shard& shard,
                                                   const ReconstructReport& empty) const {
  const bool with_proxy = !empty.proxy.empty();
  if (!fs::exists(report(shard)) || !fs::exists(mesh(shard))) return std::nullopt;
  if (with_proxy && !fs::exists(proxy(shard))) return std::nullopt;
  try {
    const Json json = Json::parse(read_file(report(shard)));
    const Json& samples = json.at("samples");
    if (json.at("checksum") != checksum(shard, samples, with_proxy)) return std::nullopt;
    ReconstructReport found = empty;
    read_samples(samples, found);
    const std::vector<int64_t> pulses = pulses_with_meshes(shard, found);
    if (take::MeshFileReader(mesh(shard)).pulses() != pulses ||
        (with_proxy && take::MeshFileReader(proxy(shard)).pulses() != pulses)) {
      return std::nullopt;
    }
    return found;
  } catch (const Json::exception&) {
    return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void ShardFolder::drop(const Shard& shard) const {
  std::error_code absent;
  fs::remove(report(shard), absent);
  fs::remove(mesh(shard), absent);
  fs::remove(proxy(shard), absent);
}

std::set<int64_t> ShardFolder::saved() const {
  std::set<int64_t> numbers;
  for (const fs::path& path : entries_of(path_, "shard-")) {
    long long number = -1;
    if (path.extension() != ".json") continue;
    if (std::sscanf(path.filename().c_str(), "shard-%lld.json", &number) == 1) {
      numbers.insert(number);
    }
  }
  return numbers;
}

void ShardFolder::save_error(const std::string& reason) const {
  replace_file(path_ / ("error-" + process_suffix()), reason);
}

std::optional<std::string> ShardFolder::saved_error() const {
  for (const fs::path& path : entries_of(path_, "error-")) {
    if (!io::is_temporary(path)) return read_file(path);
  }
  return std::nullopt;
}

void ShardFolder::remove_messages() const {
  std::error_code ignored;
  for (const char* prefix : {"error-", "task-"}) {
    for (const fs::path& path : entries_of(path_, prefix)) fs::remove(path, ignored);
  }
}

void ShardFolder::remove() const {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void ShardFolder::remove_others() const {
  for (const fs::path& path : entries_of(path_.parent_path(), kPrefix)) {
    if (path == path_) continue;
    const ShardFolder other(path);
    if (ShardFolderLock(other).state() == ShardFolderLock::State::kHeld) other.remove();
  }
}

ShardFolderLock::ShardFolderLock(const ShardFolder& folder) {
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
