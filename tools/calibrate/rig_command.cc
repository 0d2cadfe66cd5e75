#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/colour.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "calib/rig/reports.h"
#include "calib/rig/rig_fit.h"
#include "calib/rig/time_offset.h"
#include "calibrate/calibrate_commands.h"
#include "calibrate/rig_boards.h"
#include "common/console.h"
#include "common/data_url.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string board;
  RigArguments sources;
  std::string before;
  std::string out;
  std::string report;
  bool json = false;
};

Json to_json(const calib::RigFit& fit) {
  Json cameras = Json::array(), pairs = Json::array(), rejected = Json::array();
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const calib::CameraFit& camera = fit.cameras[i];
    cameras.push_back({{"name", fit.rig[i].name},
                       {"rms_px", camera.rms_px},
                       {"views", camera.views},
                       {"found", camera.found},
                       {"rejected", camera.rejected},
                       {"late", camera.time_offset},
                       {"coverage", camera.coverage},
                       {"coefficients", camera.coefficients}});
  }
  for (const calib::PairPose& pair : fit.pairs) {
    pairs.push_back({{"cameras", {fit.rig[pair.a].name, fit.rig[pair.b].name}},
                     {"shared", pair.shared},
                     {"agreeing", pair.inliers}});
  }
  for (const auto& observation : fit.rejected) {
    rejected.push_back({{"camera", fit.rig[observation.camera].name},
                        {"instant", observation.instant},
                        {"reason", observation.reason}});
  }
  return {{"rms_px", fit.rms_px}, {"boards", fit.world_from_board.size()},
          {"cameras", cameras},   {"weak", find_weaknesses(fit)},
          {"pairs", pairs},       {"rejected", rejected}};
}

void print_text(const calib::RigFit& fit) {
  size_t widest = 0;
  for (const RigCamera& camera : fit.rig) widest = std::max(widest, camera.name.size());
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const calib::CameraFit& camera = fit.cameras[i];
    std::printf("%-*s  %.2f px RMS, %s, %.0f %% of the image", static_cast<int>(widest),
                fit.rig[i].name.c_str(), camera.rms_px, ctl::count_of(camera.views, "view").c_str(),
                100 * camera.coverage);
    if (camera.rejected > 0) std::printf(", %d rejected", camera.rejected);
    std::printf("\n");
  }
  for (const std::string& weak : find_weaknesses(fit)) std::printf("weak: %s\n", weak.c_str());
  std::printf("rig: %.2f px RMS, %s, %s\n", fit.rms_px,
              ctl::count_of(std::ssize(fit.rig), "camera").c_str(),
              ctl::count_of(std::ssize(fit.world_from_board), "board").c_str());
}

void note_time_offsets(const std::vector<calib::CameraObservations>& cameras,
                       const calib::RigFit& fit) {
  std::vector<double> late;
  for (const calib::CameraFit& camera : fit.cameras) late.push_back(camera.time_offset);
  const std::string text = time_offset_text(cameras, late);
  if (!text.empty())
    note("v3dctl: " + text +
         "; corrected in this calibration, but must be fixed before the next take");
}

/// By camera the image with most corners, for the report.
std::vector<std::string> images_of(const RigBoards& boards) {
  constexpr int kQuality = 60;
  std::vector<std::string> images;
  for (const FoundBoards& found : boards.found) {
    images.push_back(found.example
                         ? data_url(encode_jpeg(to_rgb(found.example->view()).view(), kQuality))
                         : std::string());
  }
  return images;
}

/// With frames in runs in which every time offset is found that the fit looks for.
RigSources rig_sources(const ctl::CommandLine& line, const Arguments& arguments) {
  RigSources sources = arguments.sources.sources(line);
  if (sources.sampling.every == 0) sources.sampling.run = calib::kMaxTimeOffset + 1;
  if (sources.sampling.every > 1) {
    note("v3dctl: --every leaves no consecutive frames: cameras out of sync are not found");
  }
  return sources;
}

void check_outputs(const Arguments& arguments) {
  ctl::check_output({"--out", arguments.out});
  ctl::check_output({"--report", arguments.report});
  ctl::require_other_file({"--report", arguments.report},
                          {{"--out", arguments.out}, {"--before", arguments.before}});
}

int run(const ctl::CommandLine& line, const Arguments& arguments) {
  check_outputs(arguments);
  const calib::BoardDetector detector(calib::parse_board(arguments.board));
  calib::RigOptions options;
  if (!arguments.before.empty()) options.previous = load_calib(arguments.before);
  ctl::catch_interrupts();
  const RigSources sources = rig_sources(line, arguments);
  options.time_offset_remedy = time_offset_remedy(sources);
  const RigBoards boards = find_rig_boards(sources, detector);
  if (boards.cameras.size() < 2) throw InputError("a rig needs at least two cameras");
  const calib::RigFit fit = fit_rig(detector.board(), boards.cameras, options);
  note_time_offsets(boards.cameras, fit);
  save_result(arguments.out, fit.rig);
  if (arguments.json) {
    std::printf("%s\n", to_json(fit).dump(2).c_str());
  } else {
    print_text(fit);
    std::printf("wrote %s; its upward axis is only estimated; next step: v3dctl calibrate floor\n",
                arguments.out.c_str());
  }
  if (!arguments.report.empty()) {
    replace_file(arguments.report, rig_report_html(detector.board(), fit, images_of(boards)));
  }
  return kExitDone;
}

}  // namespace

void add_rig(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command = add_under(
      calibrate, "rig", "Calibrate all cameras together, from a board carried through the studio",
      {"v3dctl calibrate rig --board chess:9x6:80mm --take boards-01 --out calib.toml",
       "v3dctl calibrate rig --board charuco:4x5:54mm:40.5mm:DICT_4X4_50 --out calib.toml \\",
       "    --video cam1=1.mp4 --video cam2=2.mp4",
       "v3dctl calibrate rig --board chess:9x6:80mm --live 120 --out calib.toml"});
  auto arguments = std::make_shared<Arguments>();
  add_board_option(command, arguments->board);
  arguments->sources.add_to(command);
  arguments->sources.add_time_stamps_to(command);
  command
      .add_option(
          "--before", arguments->before,
          "The previous calibration: its lenses and colours are used; swapped cameras and another "
          "board size are reported")
      .type_name("FILE");
  command.add_option("--out", arguments->out, "The calibration to write")
      .type_name("FILE")
      .required();
  command
      .add_option("--report", arguments->report,
                  "Also write an HTML report: residuals, coverage, shared views, weaknesses")
      .type_name("FILE.html");
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::calibrate
