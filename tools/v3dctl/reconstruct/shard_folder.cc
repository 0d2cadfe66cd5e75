#include "v3dctl/reconstruct/shard_folder.h"

#include <fmt/core.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "base/core/error.h"
#include "codec/frame_codec.h"
#include "take/logs/mesh_file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string name_of(const TakeShard& shard) { return fmt::format("{:06}", shard.number); }

}  // namespace

std::vector<TakeShard> shards_of(const std::vector<int64_t>& pulses) {
  const int64_t length = codec::EncoderOptions().key_every;
  std::vector<TakeShard> shards;
  for (const int64_t pulse : pulses) {
    if (shards.empty() || shards.back().number != pulse / length) {
      shards.push_back({pulse / length, {}});
    }
    shards.back().pulses.push_back(pulse);
  }
  return shards;
}

std::vector<int64_t> pulses_with_meshes(const TakeShard& shard, const ReconstructReport& report) {
  std::vector<int64_t> pulses = shard.pulses;
  for (const auto& [oversized, reason] : report.oversized) std::erase(pulses, oversized);
  return pulses;
}

ShardFolder ShardFolder::create(const ReconstructRequest& complete,
                                const recorded::TakeFrames& take) {
  return ShardFolder(TaskFolder::create(take.paths().folder, ".shards-", request_to_json(complete),
                                        input_states(take))
                         .path());
}

ReconstructRequest ShardFolder::request() const {
  const Json saved = saved_request();
  try {
    ReconstructRequest request = request_from_json(saved);
    request.take = path().parent_path();
    return request;
  } catch (const Json::exception&) {
    throw InputError((path() / "request.json").string() + ": is no request of v3dctl reconstruct");
  }
}

fs::path ShardFolder::mesh(const TakeShard& shard) const {
  return shard_file(name_of(shard), ".v3d");
}
fs::path ShardFolder::proxy(const TakeShard& shard) const {
  return shard_file(name_of(shard), ".proxy.v3d");
}

std::vector<fs::path> ShardFolder::files(const TakeShard& shard, bool with_proxy) const {
  std::vector<fs::path> files{mesh(shard)};
  if (with_proxy) files.push_back(proxy(shard));
  return files;
}

void ShardFolder::save(const TakeShard& shard, const ReconstructReport& report) const {
  save_samples(name_of(shard), files(shard, !report.proxy.empty()), samples_to_json(report));
}

std::optional<ReconstructReport> ShardFolder::find(const TakeShard& shard,
                                                   const ReconstructReport& empty) const {
  const bool with_proxy = !empty.proxy.empty();
  const auto samples = find_samples(name_of(shard), files(shard, with_proxy));
  if (!samples) return std::nullopt;
  try {
    ReconstructReport found = empty;
    read_samples(*samples, found);
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

void ShardFolder::drop(const TakeShard& shard) const {
  TaskFolder::drop(name_of(shard), files(shard, true));
}

std::set<int64_t> ShardFolder::saved() const {
  std::set<int64_t> numbers;
  for (const std::string& name : saved_shards()) {
    long long number = -1;
    if (std::sscanf(name.c_str(), "%lld", &number) == 1) numbers.insert(number);
  }
  return numbers;
}

}  // namespace v3d::ctl
