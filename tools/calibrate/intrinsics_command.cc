#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "base/core/error.h"
#include "base/core/text.h"
#include "calib/boards/board.h"
#include "calibrate/calibrate_commands.h"
#include "calibrate/calibration_images.h"
#include "calibrate/rig_boards.h"
#include "common/console.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string board;
  std::string images;
  std::string video;
  std::string take;
  double live_s = 0;
  std::string camera = "cam";
  Sampling sampling;
  calib::LensOptions lens;
  std::string out;
  bool json = false;
};

void require_camera(const Studio& studio, const std::string& name) {
  const bool known = std::any_of(studio.cameras.begin(), studio.cameras.end(),
                                 [&](const StudioCamera& camera) { return camera.name == name; });
  if (!known) throw InputError("--camera " + name + ": no such camera in " + studio.path.string());
}

ImageSource open_source(const ctl::CommandLine& line, const Arguments& arguments) {
  const int source_count = !arguments.images.empty() + !arguments.video.empty() +
                           !arguments.take.empty() + (arguments.live_s > 0);
  if (source_count != 1)
    throw InputError("use exactly one of --images, --video, --take and --live");
  require_no_interval_of_images(arguments.sampling, !arguments.images.empty());
  if (!arguments.images.empty()) return open_images(arguments.images);
  if (!arguments.video.empty()) return open_videos({arguments.video}, arguments.sampling).front();
  if (!arguments.take.empty()) {
    return open_take(arguments.take, {arguments.camera}, arguments.sampling).front();
  }
  const Studio studio = line.studio();
  require_camera(studio, arguments.camera);
  return open_take(record_live_take(studio, arguments.live_s), {arguments.camera},
                   arguments.sampling)
      .front();
}

double covered(const FoundBoards& found, const calib::LensFit& fit) {
  std::vector<const calib::BoardObservation*> observations;
  for (const auto& view : fit.fitted) observations.push_back(&found.views[view.view].observation);
  return calib::coverage(found.size, observations);
}

Json to_json(const std::string& camera, const FoundBoards& found, const calib::LensFit& fit) {
  Json rejected = Json::array(), trials = Json::array();
  for (const auto& view : fit.rejected) {
    rejected.push_back({{"picture", found.views[view.view].source}, {"reason", view.reason}});
  }
  for (const auto& trial : fit.trials) {
    trials.push_back(
        {{"coefficients", trial.coefficients}, {"held_out_rms_px", trial.held_out_rms_px}});
  }
  const Eigen::Matrix3d& k = fit.lens.matrix();
  const Json one = {{"name", camera},
                    {"rms_px", fit.rms_px},
                    {"views", fit.fitted.size()},
                    {"found", found.views.size()},
                    {"pictures", found.images},
                    {"coverage", covered(found, fit)},
                    {"focal_px", {k(0, 0), k(1, 1)}},
                    {"focal_spread_px", fit.focal_deviation_px},
                    {"centre_px", {k(0, 2), k(1, 2)}},
                    {"coefficients", fit.coefficients},
                    {"distortions", fit.lens.distortion()},
                    {"cross_validation", trials},
                    {"weak", find_weaknesses(camera, fit)},
                    {"rejected", rejected}};
  return {{"rms_px", fit.rms_px}, {"cameras", Json::array({one})}};
}

void print_text(const std::string& camera, const FoundBoards& found, const calib::LensFit& fit) {
  std::printf("%s  %.2f px RMS, %s of %lld with the board (%lld searched), %.0f %% of the image\n",
              camera.c_str(), fit.rms_px, ctl::count_of(std::ssize(fit.fitted), "image").c_str(),
              static_cast<long long>(found.views.size()), static_cast<long long>(found.images),
              100 * covered(found, fit));
  const Eigen::Matrix3d& k = fit.lens.matrix();
  std::printf(
      "  focal length %.1f x %.1f px (+- %.1f, 1 sigma), centre %.1f, %.1f, %d coefficients\n",
      k(0, 0), k(1, 1), fit.focal_deviation_px, k(0, 2), k(1, 2), fit.coefficients);
  for (const auto& trial : fit.trials) {
    std::printf("  %d coefficients: %.3f px RMS in held-out images\n", trial.coefficients,
                trial.held_out_rms_px);
  }
  for (const auto& view : fit.rejected) {
    std::printf("  rejected: %s: %s\n", found.views[view.view].source.c_str(), view.reason.c_str());
  }
  for (const std::string& weak : find_weaknesses(camera, fit))
    std::printf("weak: %s\n", weak.c_str());
}

void require_camera_name(const Arguments& arguments) {
  if (!is_camera_name(arguments.camera)) {
    throw InputError("--camera " + arguments.camera + ": " + std::string(kCameraNameRule));
  }
}

int run(const ctl::CommandLine& line, const Arguments& arguments) {
  ctl::check_output({"--out", arguments.out});
  require_camera_name(arguments);
  const calib::BoardDetector detector(calib::parse_board(arguments.board));
  ctl::catch_interrupts();
  const FoundBoards found = find_boards(arguments.camera, open_source(line, arguments), detector);
  const calib::LensFit fit =
      fit_lens(arguments.camera, detector.board(), found.size, found.views, arguments.lens);
  if (!arguments.out.empty()) save_result(arguments.out, {{arguments.camera, fit.lens}});
  if (arguments.json) {
    std::printf("%s\n", to_json(arguments.camera, found, fit).dump(2).c_str());
  } else {
    print_text(arguments.camera, found, fit);
  }
  return kExitDone;
}

}  // namespace

void add_intrinsics(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command =
      add_under(calibrate, "intrinsics", "Calibrate the lens of one camera",
                {"v3dctl calibrate intrinsics --board chess:9x6:25mm --images 'cam01/*.png'",
                 "v3dctl calibrate intrinsics --board charuco:4x5:54mm:40.5mm:DICT_4X4_50 \\",
                 "    --video cam01.mp4 --camera cam01 --out cam01.toml"});
  auto arguments = std::make_shared<Arguments>();
  add_board_option(command, arguments->board);
  command.add_option("--images", arguments->images, "Images of the board; quote the pattern")
      .type_name("GLOB");
  command.add_option("--video", arguments->video, "A video of the board").type_name("FILE");
  command.add_option("--take", arguments->take, "A take of the board, of the camera --camera")
      .type_name("TAKE");
  add_live_option(command, arguments->live_s);
  command.add_option("--camera", arguments->camera, "Name of the camera (default: cam)")
      .type_name("NAME");
  command
      .add_option("--every", arguments->sampling.every,
                  "Use every Nth frame (default: about 300 frames)")
      .type_name("N")
      .check(cli::positive_number());
  command
      .add_option("--coefficients", arguments->lens.coefficients,
                  "Number of distortion coefficients: 4, 5 or 8 (default: by cross-validation)")
      .check(cli::one_of({4, 5, 8}));
  command.add_option("--out", arguments->out, "Write the lens as a calib.toml of one camera")
      .type_name("FILE");
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::calibrate
