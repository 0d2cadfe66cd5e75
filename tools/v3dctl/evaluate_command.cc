#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "v3dctl/command.h"
#include "v3dctl/evaluate.h"
#include "v3dctl/interrupt.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::filesystem::path take;
  std::filesystem::path truth;
  std::string held_out;
  bool view_dependent = false;
  bool json = false;
};

void put_truth(Json& json, const TruthReport& report) {
  const SurfaceDistance& d = report.distance;
  json["frames"] = report.frames;
  json["distance_mm"] = {{"accuracy_p50", d.accuracy_p50_mm},
                         {"accuracy_p90", d.accuracy_p90_mm},
                         {"completeness_p50", d.completeness_p50_mm},
                         {"completeness_p90", d.completeness_p90_mm}};
  json["f_score"] = {{"2mm", d.f_score_2mm}, {"5mm", d.f_score_5mm}, {"10mm", d.f_score_10mm}};
  json["normal_error_deg"] = d.normal_error_deg;
  json["self_intersections"] = report.self_intersections;
}

void put_held_out(Json& json, const std::vector<HeldOutReport>& reports) {
  json["held_out"] = Json::array();
  for (const HeldOutReport& report : reports) {
    Json entry = {{"camera", report.camera},
                  {"frames", report.frames},
                  {"psnr_db", nullptr},
                  {"ssim", nullptr},
                  {"iou", nullptr}};
    if (report.frames > 0) {
      entry["psnr_db"] = report.psnr_db;
      entry["ssim"] = report.ssim;
      entry["iou"] = report.iou;
    }
    json["held_out"].push_back(entry);
  }
}

void print_truth(const TruthReport& report) {
  const SurfaceDistance& d = report.distance;
  std::printf("%lld frames against the truth (medians over frames)\n",
              static_cast<long long>(report.frames));
  std::printf("accuracy      %.2f mm half, %.2f mm nine tenths of the surface\n", d.accuracy_p50_mm,
              d.accuracy_p90_mm);
  std::printf("completeness  %.2f mm half, %.2f mm nine tenths of the truth\n",
              d.completeness_p50_mm, d.completeness_p90_mm);
  std::printf("f-score       %.3f at 2 mm, %.3f at 5 mm, %.3f at 10 mm\n", d.f_score_2mm,
              d.f_score_5mm, d.f_score_10mm);
  std::printf("normals       %.1f degrees off\n", d.normal_error_deg);
  std::printf("crossings     %.0f pairs of triangles go through each other\n",
              report.self_intersections);
}

void print_held_out(const std::vector<HeldOutReport>& reports) {
  for (const HeldOutReport& report : reports) {
    std::printf("%-12s  %.2f dB PSNR, %.4f SSIM, %.4f IoU over %lld frames\n",
                report.camera.c_str(), report.psnr_db, report.ssim, report.iou,
                static_cast<long long>(report.frames));
  }
}

int run(const Arguments& arguments) {
  const std::vector<std::string> cameras = parse_names(arguments.held_out, "--held-out");
  if (arguments.truth.empty() && cameras.empty()) {
    throw InputError("evaluate: give --truth DIR, --held-out CAM,... or both");
  }
  catch_interrupts();
  Json json = {
      {"frames", nullptr},           {"distance_mm", nullptr},        {"f_score", nullptr},
      {"normal_error_deg", nullptr}, {"self_intersections", nullptr}, {"held_out", Json::array()}};
  int status = kExitDone;
  if (!arguments.truth.empty()) {
    const TruthReport report = evaluate_truth(arguments.take, arguments.truth);
    put_truth(json, report);
    if (!arguments.json) print_truth(report);
    if (report.without_truth > 0) {
      std::fprintf(stderr, "v3dctl: %lld frames have no truth in %s\n",
                   static_cast<long long>(report.without_truth), arguments.truth.c_str());
      status = kExitNotWhole;
    }
  }
  if (!cameras.empty()) {
    const std::vector<HeldOutReport> reports =
        evaluate_held_out(arguments.take, cameras, arguments.view_dependent);
    put_held_out(json, reports);
    if (!arguments.json) print_held_out(reports);
  }
  if (arguments.json) std::printf("%s\n", json.dump(2).c_str());
  return status;
}

}  // namespace

void add_evaluate(CommandLine& line) {
  CLI::App* command = line.add(
      "evaluate", "Measure the meshes of a take against the truth or against cameras left out",
      {"v3dctl evaluate sim-01 --truth truth --json",
       "v3dctl reconstruct dancer --leave-out cam03 && v3dctl evaluate dancer --held-out cam03"});
  auto arguments = std::make_shared<Arguments>();
  command->add_option("TAKE", arguments->take, "The folder of a reconstructed take")->required();
  command
      ->add_option("--truth", arguments->truth,
                   "The true surface of frame 12 is DIR/000012.ply, and so on")
      ->type_name("DIR");
  command
      ->add_option("--held-out", arguments->held_out,
                   "Cameras that took no part (reconstruct --leave-out): the mesh is drawn as they "
                   "see it and held against their pictures")
      ->type_name("CAM,...");
  command->add_flag("--view-dependent", arguments->view_dependent,
                    "Draw in the colours for the viewpoint of the camera that was left out");
  add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
