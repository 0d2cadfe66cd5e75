#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/calib_file.h"
#include "base/demosaic.h"
#include "base/error.h"
#include "base/file.h"
#include "base/html.h"
#include "base/jpeg.h"
#include "calib/advice.h"
#include "calib/report.h"
#include "calib/rig_fit.h"
#include "calibrate/commands.h"
#include "calibrate/rig_boards.h"
#include "common/console.h"
#include "v3dctl/process.h"

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
                       {"late", camera.late},
                       {"coverage", camera.coverage},
                       {"coefficients", camera.coefficients}});
  }
  for (const calib::PairPose& pair : fit.pairs) {
    pairs.push_back({{"cameras", {fit.rig[pair.a].name, fit.rig[pair.b].name}},
                     {"shared", pair.shared},
                     {"agreeing", pair.agreeing}});
  }
  for (const auto& sighting : fit.rejected) {
    rejected.push_back({{"camera", fit.rig[sighting.camera].name},
                        {"instant", sighting.instant},
                        {"reason", sighting.reason}});
  }
  return {{"rms_px", fit.rms_px}, {"boards", fit.world_from_board.size()},
          {"cameras", cameras},   {"weak", advice(fit)},
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
    if (camera.rejected > 0) std::printf(", %d left out", camera.rejected);
    std::printf("\n");
  }
  for (const std::string& weak : advice(fit)) std::printf("weak: %s\n", weak.c_str());
  std::printf("rig: %.2f px RMS, %s, %s\n", fit.rms_px,
              ctl::count_of(std::ssize(fit.rig), "camera").c_str(),
              ctl::count_of(std::ssize(fit.world_from_board), "board").c_str());
}

void note_lateness(const std::vector<calib::CameraSightings>& cameras, const calib::RigFit& fit) {
  std::vector<double> late;
  for (const calib::CameraFit& camera : fit.cameras) late.push_back(camera.late);
  const std::string text = lateness_text(cameras, late);
  if (!text.empty()) note("v3dctl: " + text + "; put right here, but the next take needs a mend");
}

/// By camera the picture that shows most of the board, for the report.
std::vector<std::string> pictures_of(const RigBoards& boards) {
  constexpr int kQuality = 60;
  std::vector<std::string> pictures;
  for (const FoundBoards& found : boards.found) {
    pictures.push_back(found.example
                           ? data_url(encode_jpeg(to_rgb(found.example->view()).view(), kQuality))
                           : std::string());
  }
  return pictures;
}

int run(const ctl::CommandLine& line, const Arguments& arguments) {
  const calib::BoardDetector detector(calib::parse_board(arguments.board));
  calib::RigOptions options;
  if (!arguments.before.empty()) options.before = load_calib(arguments.before);
  ctl::catch_interrupts();
  const RigBoards boards = find_rig_boards(arguments.sources.sources(line), detector);
  if (boards.cameras.size() < 2) throw InputError("a rig has two cameras or more");
  const calib::RigFit fit = fit_rig(detector.board(), boards.cameras, options);
  note_lateness(boards.cameras, fit);
  save_calib(arguments.out, fit.rig);
  if (!arguments.report.empty()) {
    replace_file(arguments.report, report_html(detector.board(), fit, pictures_of(boards)));
  }
  if (arguments.json) {
    std::printf("%s\n", to_json(fit).dump(2).c_str());
  } else {
    print_text(fit);
    std::printf(
        "wrote %s; up is guessed: v3dctl calibrate floor makes a board on the floor z = 0\n",
        arguments.out.c_str());
  }
  return kExitDone;
}

}  // namespace

void add_rig(ctl::CommandLine& line, CLI::App* calibrate) {
  CLI::App* command = add_under(
      calibrate, "rig", "All cameras together, from a board carried through the studio",
      {"v3dctl calibrate rig --board chess:9x6:80mm --take boards-01 --out calib.toml",
       "v3dctl calibrate rig --board charuco:4x5:54mm:40.5mm:DICT_4X4_50 --out calib.toml \\",
       "    --video cam1=1.mp4 --video cam2=2.mp4",
       "v3dctl calibrate rig --board chess:9x6:80mm --live 120 --out calib.toml"});
  auto arguments = std::make_shared<Arguments>();
  add_board_option(command, arguments->board);
  arguments->sources.add_to(command);
  command
      ->add_option("--before", arguments->before,
                   "The cameras as calibrated before: their lenses stay; swapped cameras and "
                   "another board size are noticed")
      ->type_name("FILE");
  command->add_option("--out", arguments->out, "The calibration to write")
      ->type_name("FILE")
      ->required();
  command
      ->add_option("--report", arguments->report,
                   "A page for people: errors, coverage, shared views, and what to mend")
      ->type_name("FILE.html");
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::calibrate
