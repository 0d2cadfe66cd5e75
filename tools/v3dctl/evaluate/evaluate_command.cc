// evaluate: prints the measurements of evaluate.h, and writes the page.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/recorded_file.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/mesh_options.h"
#include "v3dctl/options.h"

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

bool has_all_truth(const TruthReport& report, const std::filesystem::path& truth,
                   const std::string& meshes) {
  if (report.without_truth == 0) return true;
  note("v3dctl: no truth in " + truth.string() + " for " + count_of(report.without_truth, "frame") +
       " of " + meshes);
  return false;
}

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
  const auto known = [](int64_t frames, double figure) {
    return frames > 0 ? Json(figure) : Json(nullptr);
  };
  json["flicker_mm"] = {{"p50", known(report.still_frames, c.flicker_p50_mm)},
                        {"p90", known(report.still_frames, c.flicker_p90_mm)},
                        {"still_part", c.still}};
  json["moving_mm"] = {{"p50", known(report.moving_frames, c.moving_p50_mm)},
                       {"p90", known(report.moving_frames, c.moving_p90_mm)},
                       {"moving_part", c.moving}};
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

namespace {

struct Arguments {
  std::filesystem::path take;
  std::filesystem::path truth;
  std::filesystem::path beside;
  std::filesystem::path report;
  std::string held_out;
  bool view_dependent = false;
  std::string view_source = "automatic";
  int atlas_side = 0;
  bool json = false;
};

Json to_json(const ImageSimilarity& similarity) {
  return {{"psnr_db", similarity.psnr_db}, {"ssim", similarity.ssim}};
}

void put_held_out(Json& json, const std::vector<HeldOutReport>& reports) {
  json["held_out"] = Json::array();
  for (const HeldOutReport& report : reports) {
    Json entry = {{"camera", report.camera}, {"frames", report.frames}, {"psnr_db", nullptr},
                  {"ssim", nullptr},         {"iou", nullptr},          {"whole_mask", nullptr},
                  {"true_surface", nullptr}};
    if (report.frames > 0) {
      entry.update(to_json(report.inside));
      entry["iou"] = report.iou;
      entry["whole_mask"] = to_json(report.whole_mask);
    }
    if (report.atlas) entry["atlas"] = to_json(*report.atlas);
    if (report.true_surface) entry["true_surface"] = to_json(*report.true_surface);
    json["held_out"].push_back(entry);
  }
}

void print_change(const TruthReport& report) {
  const recon::SurfaceChange& change = report.change;
  if (report.still_frames > 0) {
    std::printf("flicker       %.2f mm (median), %.2f mm (90 %%) of the still surface (%.0f %%)\n",
                change.flicker_p50_mm, change.flicker_p90_mm, 100 * change.still);
  }
  if (report.moving_frames > 0) {
    std::printf("moving        %.2f mm (median), %.2f mm (90 %%) of the moving surface (%.0f %%)\n",
                change.moving_p50_mm, change.moving_p90_mm, 100 * change.moving);
  }
}

void print_truth(const TruthReport& report) {
  const recon::SurfaceDistance& d = report.distance;
  std::printf("%lld frames against the truth (medians over frames)\n",
              static_cast<long long>(report.frames));
  std::printf("accuracy      %.2f mm (median), %.2f mm (90 %%), mesh to truth\n", d.accuracy_p50_mm,
              d.accuracy_p90_mm);
  std::printf("completeness  %.2f mm (median), %.2f mm (90 %%), truth to mesh\n",
              d.completeness_p50_mm, d.completeness_p90_mm);
  std::printf("f-score       %.3f at 2 mm, %.3f at 5 mm, %.3f at 10 mm\n", d.f_score_2mm,
              d.f_score_5mm, d.f_score_10mm);
  std::printf("covered       %.3f of the truth within 10 mm, %.3f in the worst frame\n",
              d.covered_10mm, report.min_covered_10mm);
  std::printf("              in one component in %lld frames\n",
              static_cast<long long>(report.joined_frames));
  const auto& seen = report.visibility.seen_by;
  std::printf(
      "visibility    %.3f of the truth seen by no camera, %.3f by one; f-score at 5 mm if all seen "
      "by two were right: %.3f\n",
      seen[0].truth, seen[1].truth, report.visibility.f_score_if_right_from(2));
  std::printf("normals       %.1f degrees error\n", d.normal_error_deg);
  std::printf("intersections %.0f pairs of triangles\n", report.self_intersections);
  if (report.consecutive > 0) print_change(report);
}

void print_held_out(const std::vector<HeldOutReport>& reports) {
  for (const HeldOutReport& report : reports) {
    if (report.frames == 0) {
      std::printf("%-12s  no frame with foreground\n", report.camera.c_str());
      continue;
    }
    std::printf("%-12s  %.2f dB PSNR, %.4f SSIM, %.4f IoU over %lld frames\n",
                report.camera.c_str(), report.inside.psnr_db, report.inside.ssim, report.iou,
                static_cast<long long>(report.frames));
    if (report.atlas) {
      std::printf("%-12s  %.2f dB PSNR, %.4f SSIM with a texture atlas\n", "",
                  report.atlas->psnr_db, report.atlas->ssim);
    }
    if (!report.true_surface) continue;
    std::printf("%-12s  %.2f dB PSNR, %.4f SSIM with the true surface\n", "",
                report.true_surface->psnr_db, report.true_surface->ssim);
  }
}

void print_motion(const MotionReport& report) {
  std::printf("motion        %.1f pulses in a segment (mean); %.0f %% of the seen points bound\n",
              report.mean_segment_pulses, 100 * report.bound);
  for (const CarriedReport& after : report.carried) {
    std::printf("after %-7lld %.1f mm (median), %.1f mm (90 %%); sleeves %.1f mm along the surface",
                static_cast<long long>(after.pulses), after.all.p50_mm, after.all.p90_mm,
                after.sleeves.tangential_p50_mm);
    if (after.nearest_point) {
      std::printf("; nearest points %.1f mm, %.1f mm", after.nearest_point->p50_mm,
                  after.nearest_point->p90_mm);
    }
    std::printf("\n");
  }
}

recorded::ViewSource view_source_of(const Arguments& arguments) {
  return resolved_view_source(arguments.view_source, arguments.take);
}

EvaluationColumn measure(const Arguments& arguments, const std::vector<std::string>& cameras,
                         const std::string& name, const EvaluatedMeshes& evaluated) {
  EvaluationColumn column{.name = name, .evaluated = evaluated, .truth = {}, .held_out = {}};
  if (!arguments.truth.empty()) {
    column.truth = evaluate_truth(evaluated, arguments.truth);
    column.motion = evaluate_motion(evaluated, arguments.truth);
  }
  if (!cameras.empty()) {
    column.held_out = evaluate_held_out(evaluated, {.cameras = cameras,
                                                    .view_dependent = arguments.view_dependent,
                                                    .view_source = view_source_of(arguments),
                                                    .truth = arguments.truth,
                                                    .atlas_side = arguments.atlas_side});
  }
  return column;
}

Json to_json(const EvaluationColumn& column) {
  Json json = {{"frames", nullptr},           {"distance_mm", nullptr},
               {"f_score", nullptr},          {"covered", nullptr},
               {"normal_error_deg", nullptr}, {"self_intersections", nullptr},
               {"seen_by", nullptr},          {"flicker_mm", nullptr},
               {"moving_mm", nullptr},        {"held_out", Json::array()}};
  if (column.truth) put_truth(json, *column.truth);
  if (!column.held_out.empty()) put_held_out(json, column.held_out);
  if (column.motion) json["motion"] = to_json(*column.motion);
  return json;
}

void print_text(const std::vector<EvaluationColumn>& columns) {
  for (const EvaluationColumn& column : columns) {
    if (columns.size() > 1) std::printf("%s\n", column.name.c_str());
    if (column.truth) print_truth(*column.truth);
    if (!column.held_out.empty()) print_held_out(column.held_out);
    if (column.motion) print_motion(*column.motion);
  }
}

void print_json(const std::vector<EvaluationColumn>& columns) {
  Json json = to_json(columns.front());
  if (columns.size() > 1) json["beside"] = to_json(columns.back());
  std::printf("%s\n", json.dump(2).c_str());
}

/// Reports on stderr the held-out cameras without an image of a mesh. Returns kExitDone or
/// kExitIncomplete.
int report_missing_images(const Arguments& arguments,
                          const std::vector<EvaluationColumn>& columns) {
  int status = kExitDone;
  for (size_t i = 0; i < columns.front().held_out.size(); ++i) {
    int64_t missing = 0;
    for (const EvaluationColumn& column : columns) {
      missing = std::max(missing, column.held_out[i].missing);
    }
    if (missing == 0) continue;
    note("v3dctl: " + columns.front().held_out[i].camera + " is missing in " +
         count_of(missing, "frame") + ": see v3dctl verify " + arguments.take.string());
    status = kExitIncomplete;
  }
  return status;
}

/// Throws InputError for a report that could not be written after the measurements or would replace
/// a file of the take or that of --beside, and for a file of --beside without meshes.
void check_files(const Arguments& arguments) {
  const OptionFile report = {"--report", arguments.report};
  check_output(report);
  require_other_file(report, {{"--beside", arguments.beside}});
  if (!arguments.report.empty()) require_unrecorded(arguments.report);
  if (!arguments.beside.empty()) open_meshes({arguments.take, arguments.beside});
}

int run(const Arguments& arguments) {
  const std::vector<std::string> cameras = parse_names(arguments.held_out, "--held-out");
  if (arguments.truth.empty() && cameras.empty()) {
    throw InputError("evaluate: expected --truth DIR, --held-out CAM,... or both");
  }
  if (arguments.atlas_side > 0 && cameras.empty()) {
    throw InputError("--atlas: expected --held-out CAM,...");
  }
  if (arguments.view_dependent && cameras.empty()) {
    throw InputError("--view-dependent: expected --held-out CAM,...");
  }
  check_files(arguments);
  catch_interrupts();
  std::vector<EvaluationColumn> columns = {
      measure(arguments, cameras, "mesh.v3d", {arguments.take})};
  if (!arguments.beside.empty()) {
    columns.push_back(measure(arguments, cameras, arguments.beside.filename().string(),
                              {arguments.take, arguments.beside}));
  }
  if (arguments.json) {
    print_json(columns);
  } else {
    print_text(columns);
  }
  int status = report_missing_images(arguments, columns);
  for (const EvaluationColumn& column : columns) {
    if (column.truth && !has_all_truth(*column.truth, arguments.truth, column.name)) {
      status = kExitIncomplete;
    }
    status = std::max(status, report_unfinished_meshes(open_meshes(column.evaluated)));
  }
  if (!arguments.report.empty()) {
    replace_file(arguments.report, evaluation_html({.columns = std::move(columns),
                                                    .truth = arguments.truth,
                                                    .held_out = cameras,
                                                    .view_dependent = arguments.view_dependent,
                                                    .view_source = view_source_of(arguments),
                                                    .atlas_side = arguments.atlas_side}));
  }
  return status;
}

}  // namespace

void add_evaluate(CommandLine& line) {
  cli::Command command = line.add(
      "evaluate", "Measure the meshes of a take against the truth or held-out cameras",
      {"v3dctl evaluate sim-01 --truth truth --json",
       "v3dctl reconstruct dancer --leave-out cam03 && v3dctl evaluate dancer --held-out cam03",
       "v3dctl evaluate sim-01 --truth truth --beside sim-01/hull.v3d --report sim-01.html"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("TAKE", arguments->take, "The folder of a reconstructed take").required();
  command
      .add_option("--truth", arguments->truth,
                  "The true surface of frame 12 is DIR/000012.ply, and so on")
      .type_name("DIR");
  command
      .add_option(
          "--held-out", arguments->held_out,
          "Held-out cameras (reconstruct --leave-out): the mesh is rendered in their view and "
          "compared with their images")
      .type_name("CAM,...");
  const cli::Option view_dependent =
      command.add_flag("--view-dependent", arguments->view_dependent,
                       "Render with the colours for the viewpoint of the held-out camera");
  add_view_source_option(command, view_dependent, arguments->view_source);
  command
      .add_option("--atlas", arguments->atlas_side,
                  "With --held-out: compare also with a texture atlas of this size, from the raw "
                  "frames of the other cameras")
      .type_name("TEXELS")
      .check(cli::integer_in(recon::kMinAtlasSide, recon::kMaxAtlasSide));
  command
      .add_option(
          "--beside", arguments->beside,
          "Another mesh file of the same take to measure and show for comparison, such as a "
          "copy of an earlier mesh.v3d, or its motion.v3d")
      .type_name("FILE");
  command
      .add_option(
          "--report", arguments->report,
          "Write a page with the measurements, the error as colours of the mesh, photographs "
          "and renderings")
      .type_name("FILE.html");
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
