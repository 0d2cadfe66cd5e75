#include "v3dctl/reconstruct/reconstruct_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/core/error.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

template <class T>
void append_all(std::vector<T>& all, const std::vector<T>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// Measurements of each frame, with their names in JSON.
struct FrameSamples {
  const char* name;
  std::vector<double> ReconstructReport::*values;
};
constexpr FrameSamples kFrameSamples[] = {{"volume_m3", &ReconstructReport::volume_m3},
                                          {"vertices", &ReconstructReport::vertices},
                                          {"triangles", &ReconstructReport::triangles},
                                          {"components", &ReconstructReport::components},
                                          {"ghosts", &ReconstructReport::ghosts},
                                          {"bytes", &ReconstructReport::bytes},
                                          {"silhouette_iou", &ReconstructReport::silhouette_iou}};

Json fault_to_json(const PulseFault& fault) {
  const Rect& region = fault.fault.region;
  return {fault.pulse,       fault.camera, fault.fault.camera, static_cast<int>(fault.fault.kind),
          region.x0,         region.y0,    region.width,       region.height,
          fault.fault.pixels};
}

PulseFault fault_from_json(const Json& json) {
  PulseFault fault;
  fault.pulse = json.at(0);
  fault.camera = json.at(1);
  fault.fault.camera = json.at(2);
  fault.fault.kind = static_cast<recon::SilhouetteFaultKind>(json.at(3).get<int>());
  fault.fault.region = {json.at(4), json.at(5), json.at(6), json.at(7)};
  fault.fault.pixels = json.at(8);
  return fault;
}

}  // namespace

ReconstructReport empty_report(const Rig& rig, const ReconstructRequest& complete, int threads) {
  ReconstructReport report;
  for (const RigCamera& camera : rig) report.cameras.push_back(camera.name);
  report.camera_iou.resize(rig.size());
  report.bounds = *complete.bounds;
  report.voxel_m = *complete.voxel_m;
  report.quality = *complete.quality;
  report.min_views = *complete.min_views;
  report.threads = threads;
  report.repaired = complete.repair || complete.repair_pulses;
  for (const char* stage : {"segment", "intersect", "mesh", "deform", "steady", "texture", "encode",
                            "quality", "total"}) {
    report.stages.push_back({stage, {}});
  }
  if (complete.proxy_voxel_m) {
    report.proxy.push_back(empty_report(rig, proxy_request(complete), threads));
  }
  return report;
}

void append(ReconstructReport& whole, const ReconstructReport& part) {
  whole.frames += part.frames;
  whole.incomplete += part.incomplete;
  append_all(whole.oversized, part.oversized);
  for (const std::string& error : part.read_errors) {  // those of its task so far
    if (std::ranges::find(whole.read_errors, error) == whole.read_errors.end())
      whole.read_errors.push_back(error);
  }
  for (const FrameSamples& of : kFrameSamples) append_all(whole.*of.values, part.*of.values);
  for (size_t c = 0; c < whole.camera_iou.size(); ++c) {
    append_all(whole.camera_iou[c], part.camera_iou[c]);
  }
  append_all(whole.frame_quality, part.frame_quality);
  append_all(whole.silhouette_faults, part.silhouette_faults);
  for (size_t s = 0; s < whole.stages.size(); ++s) {
    append_all(whole.stages[s].ms, part.stages[s].ms);
  }
  whole.peak_rss_mb = std::max(whole.peak_rss_mb, part.peak_rss_mb);
  for (size_t p = 0; p < whole.proxy.size(); ++p) append(whole.proxy[p], part.proxy[p]);
}

void require_meshes(const ReconstructReport& first) {
  if (first.frames == 0 && !first.oversized.empty()) throw InputError(first.oversized[0].second);
}

std::vector<int64_t> pulses_with_default_passes(const ReconstructRequest& request,
                                                const ReconstructReport& report) {
  std::vector<int64_t> pulses;
  if (request.pulse_passes.empty()) return pulses;
  for (const auto& [pulse, quality] : report.frame_quality) {
    if (!request.pulse_passes.contains(pulse)) pulses.push_back(pulse);
  }
  return pulses;
}

Json samples_to_json(const ReconstructReport& part) {
  Json json = {{"frames", part.frames},
               {"incomplete", part.incomplete},
               {"oversized", part.oversized},
               {"read_errors", part.read_errors}};
  for (const FrameSamples& of : kFrameSamples) json[of.name] = part.*of.values;
  json["camera_iou"] = part.camera_iou;
  json["quality"] = Json::array();
  for (const auto& [pulse, quality] : part.frame_quality) {
    json["quality"].push_back({pulse, quality.silhouette_iou, quality.coverage, quality.cameras});
  }
  json["faults"] = Json::array();
  for (const PulseFault& fault : part.silhouette_faults) {
    json["faults"].push_back(fault_to_json(fault));
  }
  json["stages_ms"] = Json::array();
  for (const StageSamples& stage : part.stages) json["stages_ms"].push_back(stage.ms);
  json["peak_rss_mb"] = part.peak_rss_mb;
  json["proxy"] = Json::array();
  for (const ReconstructReport& proxy : part.proxy) json["proxy"].push_back(samples_to_json(proxy));
  return json;
}

void read_samples(const Json& json, ReconstructReport& part) {
  part.frames = json.at("frames");
  part.incomplete = json.at("incomplete");
  part.oversized = json.at("oversized").get<std::vector<std::pair<int64_t, std::string>>>();
  part.read_errors = json.at("read_errors").get<std::vector<std::string>>();
  for (const FrameSamples& of : kFrameSamples) {
    part.*of.values = json.at(of.name).get<std::vector<double>>();
  }
  for (size_t c = 0; c < part.camera_iou.size(); ++c) {
    part.camera_iou[c] = json.at("camera_iou").at(c).get<std::vector<double>>();
  }
  for (const Json& of : json.at("quality")) {
    part.frame_quality.emplace_back(of.at(0), recon::FrameQuality{of.at(1), of.at(2), of.at(3)});
  }
  for (const Json& fault : json.at("faults"))
    part.silhouette_faults.push_back(fault_from_json(fault));
  for (size_t s = 0; s < part.stages.size(); ++s) {
    part.stages[s].ms = json.at("stages_ms").at(s).get<std::vector<double>>();
  }
  part.peak_rss_mb = json.at("peak_rss_mb");
  for (size_t p = 0; p < part.proxy.size(); ++p)
    read_samples(json.at("proxy").at(p), part.proxy[p]);
}

}  // namespace v3d::ctl
