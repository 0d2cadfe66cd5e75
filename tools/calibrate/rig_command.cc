#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/calib_file.h"
#include "base/error.h"
#include "calib/rig_fit.h"
#include "calibrate/commands.h"
#include "calibrate/rig_boards.h"
#include "common/console.h"
#include "v3dctl/interrupt.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string board;
  std::vector<std::string> videos;
  std::vector<std::string> images;
  RigSources sources;
  std::string before;
  std::string out;
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
  return {{"rms_px", fit.rms_px},
          {"boards", fit.world_from_board.size()},
          {"cameras", cameras},
          {"pairs", pairs},
          {"rejected", rejected}};
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

int run(Arguments arguments) {
  arguments.sources.videos = ctl::parse_camera_files(arguments.videos, "--video");
  arguments.sources.images = ctl::parse_camera_files(arguments.images, "--images");
  const calib::BoardDetector detector(calib::parse_board(arguments.board));
  calib::RigOptions options;
  if (!arguments.before.empty()) options.before = load_calib(arguments.before);
  ctl::catch_interrupts();
  const RigBoards boards = find_rig_boards(arguments.sources, detector);
  if (boards.cameras.size() < 2) throw InputError("a rig has two cameras or more");
  const calib::RigFit fit = fit_rig(detector.board(), boards.cameras, options);
  note_lateness(boards.cameras, fit);
  save_calib(arguments.out, fit.rig);
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
       "    --video cam1=1.mp4 --video cam2=2.mp4"});
  auto arguments = std::make_shared<Arguments>();
  RigSources& sources = arguments->sources;
  add_board_option(command, arguments->board);
  command->add_option("--video", arguments->videos, "The video of a camera; once for each")
      ->type_name("CAM=FILE");
  command
      ->add_option("--images", arguments->images,
                   "The pictures of a camera, the n-th of all cameras of one instant; quote it")
      ->type_name("CAM=GLOB");
  command->add_option("--take", sources.take, "A take of the board, all its cameras")
      ->type_name("TAKE");
  command
      ->add_option("--timestamps", sources.time_stamps,
                   "Which frames of the videos belong together: sync_index,cam_id,frame_index")
      ->type_name("CSV");
  command
      ->add_option("--every", sources.sampling.every,
                   "Every so many frames are looked at (else about 300 frames)")
      ->type_name("N")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--before", arguments->before,
                   "The cameras as calibrated before: their lenses stay; swapped cameras and "
                   "another board size are noticed")
      ->type_name("FILE");
  command->add_option("--out", arguments->out, "The calibration to write")
      ->type_name("FILE")
      ->required();
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::calibrate
