#include "v3dctl/motion/track_folder.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>

#include "base/core/error.h"
#include "base/io/file.h"
#include "daemon/recorded/take_frames.h"
#include "take/take.h"
#include "v3dctl/motion/pulse_source.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json request_to_json(const TrackRequest& request) {
  const recon::TrackingOptions& options = request.tracking;
  return {
      {"meshes", request.meshes_only ? Json(fs::canonical(request.input).string()) : Json(nullptr)},
      {"height_m", request.height_m},
      {"frames", {request.frames.begin, request.frames.end}},
      {"step_m", request.step_m},
      {"triangles", options.triangles},
      {"node_spacing_m", options.node_spacing_m},
      {"patch_spacing_m", options.patch_spacing_m},
      {"photometry", options.photometry},
      {"heterogeneity", options.heterogeneity},
      {"fusion", options.fusion},
      {"max_far", options.max_far},
      {"max_surplus", options.max_surplus},
      {"far_m", options.far_m}};
}

/// `take`: the input where the request has no folder of meshes.
TrackRequest request_from_json(const Json& json, const fs::path& take) {
  TrackRequest request;
  const Json& meshes = json.at("meshes");
  request.meshes_only = !meshes.is_null();
  request.input = request.meshes_only ? fs::path(meshes.get<std::string>()) : take;
  request.height_m = json.at("height_m");
  request.frames.begin = json.at("frames").at(0);
  request.frames.end = json.at("frames").at(1);
  request.step_m = json.at("step_m");
  recon::TrackingOptions& options = request.tracking;
  options.triangles = json.at("triangles");
  options.node_spacing_m = json.at("node_spacing_m");
  options.patch_spacing_m = json.at("patch_spacing_m");
  options.photometry = json.at("photometry");
  options.heterogeneity = json.at("heterogeneity");
  options.fusion = json.at("fusion");
  options.max_far = json.at("max_far");
  options.max_surplus = json.at("max_surplus");
  options.far_m = json.at("far_m");
  return request;
}

Json inputs_of(const TrackRequest& request) {
  if (!request.meshes_only) {
    const recorded::TakeFrames take(request.input, {});
    Json list = input_states(take);
    list.push_back(input_state(take.paths().mesh(), take.paths().folder));
    return list;
  }
  // Not all files: the result and the task folder can be in the folder of the meshes, too.
  Json list = Json::array();
  for (const fs::path& file : mesh_files(request.input)) {
    list.push_back(input_state(file, request.input));
  }
  return list;
}

std::string name_of(const recon::SegmentRange& range) {
  return fmt::format("{:06}-{:06}", range.first, range.last);
}

std::vector<fs::path> files_of(const TaskFolder& folder, const recon::SegmentRange& range) {
  return {folder.shard_file(name_of(range), ".motion")};
}

Json quality_to_json(const recon::KeyQuality& quality) {
  return {quality.area_m2, quality.seen_share ? Json(*quality.seen_share) : Json(nullptr),
          quality.components, quality.handles};
}

recon::KeyQuality quality_from_json(const Json& json) {
  recon::KeyQuality quality;
  quality.area_m2 = json.at(0);
  if (!json.at(1).is_null()) quality.seen_share = json.at(1).get<double>();
  quality.components = json.at(2);
  quality.handles = json.at(3);
  return quality;
}

}  // namespace

TrackFolder TrackFolder::create(const TrackRequest& request) {
  const fs::path parent =
      request.meshes_only ? fs::absolute(request.out).parent_path() : request.input;
  return TrackFolder(
      TaskFolder::create(parent, ".shards-track-", request_to_json(request), inputs_of(request))
          .path());
}

TrackRequest TrackFolder::request() const {
  const Json saved = saved_request();
  try {
    return request_from_json(saved, path().parent_path());
  } catch (const Json::exception&) {
    throw InputError((path() / "request.json").string() + ": is no request of v3dctl track");
  }
}

void TrackFolder::save_survey(const recon::TakeSurvey& survey) const {
  Json qualities = Json::array();
  for (const recon::KeyQuality& quality : survey.qualities) {
    qualities.push_back(quality_to_json(quality));
  }
  replace_file(path() / "survey.json",
               Json{{"pulses", survey.pulses}, {"qualities", qualities}}.dump());
}

std::optional<recon::TakeSurvey> TrackFolder::find_survey() const {
  const fs::path file = path() / "survey.json";
  if (!fs::exists(file)) return std::nullopt;
  try {
    const Json json = Json::parse(read_file(file));
    recon::TakeSurvey survey;
    survey.pulses = json.at("pulses").get<std::vector<int64_t>>();
    for (const Json& quality : json.at("qualities")) {
      survey.qualities.push_back(quality_from_json(quality));
    }
    if (survey.qualities.size() != survey.pulses.size()) return std::nullopt;
    return survey;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

void TrackFolder::save(const recon::SegmentRange& range, const TrackedShard& shard) const {
  const std::vector<fs::path> files = files_of(*this, range);
  replace_file(files[0], shard.part.bytes);
  Json samples = {{"part", part_to_json(shard.part)}, {"read_errors", shard.read_errors}};
  save_samples(name_of(range), files, samples);
}

std::optional<TrackedShard> TrackFolder::find(const recon::SegmentRange& range) const {
  const std::vector<fs::path> files = files_of(*this, range);
  const auto samples = find_samples(name_of(range), files);
  if (!samples) return std::nullopt;
  try {
    TrackedShard shard{part_from_json(samples->at("part")), {}};
    shard.part.bytes = read_file(files[0]);
    shard.read_errors = samples->at("read_errors").get<std::vector<std::string>>();
    return shard;
  } catch (const Json::exception&) {
    return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void TrackFolder::drop(const recon::SegmentRange& range) const {
  TaskFolder::drop(name_of(range), files_of(*this, range));
}

}  // namespace v3d::ctl
