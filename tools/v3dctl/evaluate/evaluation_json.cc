#include "v3dctl/evaluate/evaluation_json.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const recon::VisibilityReport& visibility) {
  Json json;
  constexpr const char* kCameras[] = {"none", "one", "two", "more"};
  for (size_t n = 0; n < visibility.seen_by.size(); ++n) {
    const recon::VisibilityFigures& f = visibility.seen_by[n];
    json[kCameras[n]] = {{"truth", f.truth},
                         {"truth_within_5mm", f.truth_within},
                         {"reconstructed", f.reconstructed},
                         {"reconstructed_within_5mm", f.reconstructed_within}};
  }
  json["f_score_5mm_if_right_from_two"] = visibility.f_score_if_right_from(2);
  return json;
}

Json to_json(const recon::EndPointError& error) {
  return {{"points", error.points},
          {"p50_mm", error.p50_mm},
          {"p90_mm", error.p90_mm},
          {"tangential_p50_mm", error.tangential_p50_mm}};
}

}  // namespace

void put_truth(Json& json, const TruthReport& report) {
  const recon::SurfaceDistance& d = report.distance;
  json["frames"] = report.frames;
  json["distance_mm"] = {{"accuracy_p50", d.accuracy_p50_mm},
                         {"accuracy_p90", d.accuracy_p90_mm},
                         {"completeness_p50", d.completeness_p50_mm},
                         {"completeness_p90", d.completeness_p90_mm}};
  json["f_score"] = {{"2mm", d.f_score_2mm}, {"5mm", d.f_score_5mm}, {"10mm", d.f_score_10mm}};
  json["covered"] = {{"2mm", d.covered_2mm},
                     {"5mm", d.covered_5mm},
                     {"10mm", d.covered_10mm},
                     {"10mm_least", report.min_covered_10mm},
                     {"10mm_mean", report.mean_covered_10mm},
                     {"10mm_by_largest_component", d.covered_10mm_by_largest},
                     {"frames_in_one_component", report.joined_frames}};
  json["normal_error_deg"] = d.normal_error_deg;
  json["self_intersections"] = report.self_intersections;
  json["seen_by"] = to_json(report.visibility);
  if (report.consecutive == 0) return;
  const recon::SurfaceChange& c = report.change;
  json["flicker_mm"] = {
      {"p50", c.flicker_p50_mm}, {"p90", c.flicker_p90_mm}, {"still_part", c.still}};
  json["moving_mm"] = {
      {"p50", c.moving_p50_mm}, {"p90", c.moving_p90_mm}, {"moving_part", c.moving}};
}

Json to_json(const MotionReport& report) {
  Json carried = Json::array();
  for (const CarriedReport& after : report.carried) {
    Json entry = {{"pulses", after.pulses},
                  {"all", to_json(after.all)},
                  {"sleeves", to_json(after.sleeves)},
                  {"sword", to_json(after.sword)}};
    if (after.nearest_point) entry["nearest_point"] = to_json(*after.nearest_point);
    carried.push_back(entry);
  }
  return {{"first_pulse", report.first_pulse},
          {"segments", report.segments},
          {"mean_segment_pulses", report.mean_segment_pulses},
          {"bound", report.bound},
          {"carried", carried}};
}

}  // namespace v3d::ctl
