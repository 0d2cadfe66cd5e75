#include "plan/plan_command.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "cli/command.h"
#include "common/console.h"
#include "plan/coverage.h"
#include "plan/placement.h"
#include "plan/plan_plot.h"
#include "v3dctl/options.h"

namespace v3d::plan {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxCameras = 200;
constexpr double kMinSideM = 0.5, kMaxSideM = 50;
constexpr double kMinFocalMm = 1, kMaxFocalMm = 500;

struct Arguments {
  std::string space;
  int cameras = 0;
  std::string lenses;
  double sensor_width_mm = CandidateLenses{}.sensor_width_mm;
  std::string size = "1024x768";
  std::string fixed;
  std::string performer = "swordsman";
  std::string mounts = "wall";
  std::string margin = "1.5m";
  std::string heights = "0.3m:2.5m";
  int moments = ActionOptions{}.moments;
  uint64_t seed = 1;
  std::string out;
  std::string plot;
  bool json = false;
};

/// A checked request.
struct Request {
  Box space;
  ActionOptions action;
  PlacementOptions placement;
  Rig fixed;
};

Box parse_space(const std::string& text) {
  const Box space = [&] {
    try {
      return parse_bounds(text);
    } catch (const InputError&) {
      throw InputError("--space " + text +
                       ": expected X0,Y0,Z0,X1,Y1,Z1 in metres, with X0 < X1, Y0 < Y1, Z0 < Z1");
    }
  }();
  if (space.size().minCoeff() < kMinSideM || space.size().maxCoeff() > kMaxSideM) {
    throw InputError(
        fmt::format("--space {}: expected sides of {} to {} m", text, kMinSideM, kMaxSideM));
  }
  return space;
}

std::vector<double> parse_lenses(const std::string& text) {
  std::vector<double> lenses;
  for (const std::string& part : ctl::parse_names(text, "--lens")) {
    const std::optional<double> mm = cli::number_of(part);
    if (!mm || !(*mm >= kMinFocalMm && *mm <= kMaxFocalMm)) {
      throw InputError(fmt::format("--lens {}: '{}' is no focal length, expected {} to {} mm", text,
                                   part, kMinFocalMm, kMaxFocalMm));
    }
    lenses.push_back(*mm);
  }
  return lenses;
}

std::vector<Mount> parse_mounts(const std::string& text) {
  std::vector<Mount> mounts;
  for (const std::string& part : ctl::parse_names(text, "--mount")) {
    if (part == "wall") {
      mounts.push_back(Mount::kWall);
    } else if (part == "rail") {
      mounts.push_back(Mount::kRail);
    } else if (part == "ceiling") {
      mounts.push_back(Mount::kCeiling);
    } else {
      throw InputError("--mount " + text + ": expected wall, rail or ceiling, separated by commas");
    }
  }
  return mounts;
}

/// "0m": a camera on the floor. parse_length() accepts positive lengths only.
bool is_zero_length(std::string_view text) {
  double value = 1;
  return consume_number(text, value) && value == 0 && (text == "m" || text == "cm" || text == "mm");
}

MountOptions parse_mount_options(const Arguments& arguments) {
  MountOptions options;
  options.mounts = parse_mounts(arguments.mounts);
  options.margin_m = ctl::parse_length_option(arguments.margin, "--margin");
  const size_t colon = arguments.heights.find(':');
  if (colon == std::string::npos) {
    throw InputError("--heights " + arguments.heights + ": expected LOW:HIGH, like 0.3m:2.5m");
  }
  const std::string_view low = std::string_view(arguments.heights).substr(0, colon);
  options.low_m = is_zero_length(low) ? 0 : ctl::parse_length_option(low, "--heights");
  options.high_m =
      ctl::parse_length_option(std::string_view(arguments.heights).substr(colon + 1), "--heights");
  if (!(options.margin_m >= 0.2 && options.margin_m <= kMaxSideM)) {
    throw InputError("--margin " + arguments.margin + ": expected 0.2m to 50m");
  }
  if (!(options.low_m <= options.high_m && options.high_m <= kMaxSideM)) {
    throw InputError("--heights " + arguments.heights + ": expected 0m <= LOW <= HIGH <= 50m");
  }
  return options;
}

void check_outputs(const Arguments& arguments) {
  ctl::check_output({"--out", arguments.out});
  if (std::filesystem::exists(arguments.out)) {
    throw InputError(arguments.out +
                     ": exists already and is not replaced by a planned rig; use another name, or "
                     "move the file");
  }
  ctl::check_output({"--plot", arguments.plot});
  ctl::require_other_file({"--plot", arguments.plot},
                          {{"--out", arguments.out}, {"--fixed", arguments.fixed}});
}

Request parse_request(const Arguments& arguments) {
  Request request;
  request.space = parse_space(arguments.space);
  request.action.cast = arguments.performer == "duel" ? Cast::kDuel : Cast::kSwordsman;
  request.action.moments = arguments.moments;
  request.action.seed = arguments.seed;
  request.placement.cameras = arguments.cameras;
  request.placement.lens.focal_mm = parse_lenses(arguments.lenses);
  request.placement.lens.sensor_width_mm = arguments.sensor_width_mm;
  request.placement.lens.size = parse_size(arguments.size);
  request.placement.mounts = parse_mount_options(arguments);
  if (!arguments.fixed.empty()) request.fixed = load_calib(arguments.fixed);
  if (std::ssize(request.fixed) > arguments.cameras) {
    throw InputError(
        fmt::format("--fixed {}: has {}, expected at most the {} of --cameras", arguments.fixed,
                    ctl::count_of(std::ssize(request.fixed), "camera"), arguments.cameras));
  }
  check_outputs(arguments);
  return request;
}

/// The fixed cameras, then the planned ones with the first free names cam01, cam02, ...
Rig rig_of(const Rig& fixed, const CameraPlacement& placement) {
  Rig rig = fixed;
  int number = 1;
  for (const CameraModel& camera : placement.cameras) {
    std::string name;
    do {
      name = fmt::format("cam{:02}", number++);
    } while (find_camera(rig, name) >= 0);
    rig.push_back({name, camera, {}});
  }
  return rig;
}

/// Moments, places and points that differ from those of the choice.
ActionSamples held_out_action(const Request& request) {
  ActionOptions options = request.action;
  options.seed += 1'000'003;
  return sample_action(request.space, options);
}

/// NaN is written as null.
Json json_of(const Percentiles& values) {
  return {{"p10", values.p10}, {"p50", values.p50}, {"p90", values.p90}};
}

Json json_of(const SurfaceCoverage& coverage) {
  Json json;
  for (size_t i = 0; i < coverage.share.size(); ++i) {
    json["coverage"][std::to_string(i)] = coverage.share[i];
  }
  json["mm_per_pixel"] = json_of(coverage.mm_per_pixel);
  json["error_mm"] = json_of(coverage.error_mm);
  json["baseline_deg"] = {{"nearest", json_of(coverage.nearest_baseline_deg)},
                          {"widest", json_of(coverage.widest_baseline_deg)}};
  json["occlusion"] = {{"views_lost", coverage.views_lost}, {"below_two", coverage.below_two}};
  return json;
}

Json json_of(const Rig& rig, const SurfaceCoverage& coverage, const Request& request,
             const CameraPlacement& placement) {
  const size_t fixed = request.fixed.size();
  Json cameras = Json::array();
  for (size_t i = 0; i < rig.size(); ++i) {
    const Eigen::Vector3d at = rig[i].model.center(), to = rig[i].model.viewing_direction();
    Json camera = {{"name", rig[i].name},
                   {"fixed", i < fixed},
                   {"position", {at.x(), at.y(), at.z()}},
                   {"direction", {to.x(), to.y(), to.z()}},
                   {"share", coverage.camera[i]}};
    if (i >= fixed) camera["lens_mm"] = placement.focal_mm[i - fixed];
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

std::string medians_text(const SurfaceCoverage& coverage) {
  if (std::isnan(coverage.mm_per_pixel.p50)) return "no point is seen by a camera\n";
  const std::string resolution =
      fmt::format("median of seen points: {:.1f} mm per pixel", coverage.mm_per_pixel.p50);
  if (std::isnan(coverage.error_mm.p50)) {
    return resolution + "; no point is seen by two cameras\n";
  }
  return resolution + fmt::format(", error {:.1f} mm, baselines of {:.0f} to {:.0f} degrees\n",
                                  coverage.error_mm.p50, coverage.nearest_baseline_deg.p50,
                                  coverage.widest_baseline_deg.p50);
}

std::string summary(const Rig& rig, const SurfaceCoverage& coverage, const Request& request,
                    const CameraPlacement& placement) {
  std::string text;
  for (size_t i = 0; i < rig.size(); ++i) {
    const Eigen::Vector3d at = rig[i].model.center();
    const bool is_fixed = i < request.fixed.size();
    const std::string lens =
        is_fixed ? "fixed" : fmt::format("{:g} mm", placement.focal_mm[i - request.fixed.size()]);
    text += fmt::format("{:<8} {:>8}  at {:6.2f} {:6.2f} {:6.2f} m, sees {:4.1f} %\n", rig[i].name,
                        lens, at.x(), at.y(), at.z(), 100 * coverage.camera[i]);
  }
  text += fmt::format(
      "surface seen by no camera {:.1f} %, one {:.1f} %, two {:.1f} %, three or more {:.1f} %\n",
      100 * coverage.share[0], 100 * coverage.share[1], 100 * coverage.share[2],
      100 * coverage.share[3]);
  text += medians_text(coverage);
  if (request.action.cast == Cast::kDuel) {
    text += fmt::format(
        "the other performer hides {:.1f} % of the views, and leaves {:.1f} % of the surface with "
        "fewer than two\n",
        100 * coverage.views_lost, 100 * coverage.below_two);
  }
  return text;
}

int run(const Arguments& arguments) {
  const Request request = parse_request(arguments);
  const ActionSamples action = sample_action(request.space, request.action);
  const std::vector<CameraModel> fixed = models_of(request.fixed);
  CameraPlacement placement;
  {
    Progress progress("choose cameras", arguments.cameras - std::ssize(fixed), "cameras");
    placement =
        place_cameras(request.space, action, fixed, request.placement, [&] { progress.advance(); });
  }
  const Rig rig = rig_of(request.fixed, placement);
  const SurfaceCoverage coverage = measure_coverage(models_of(rig), held_out_action(request));
  // The calibration is last: its file shows that the plan is complete.
  if (!arguments.plot.empty()) {
    replace_file(arguments.plot, plot_of(rig, request.fixed.size(), request.space));
  }
  save_calib(arguments.out, rig);
  if (arguments.json) {
    Json json = json_of(coverage);
    json["cameras"] = json_of(rig, coverage, request, placement);
    json["objective"] = {{"greedy", placement.greedy_value},
                         {"exchanged", placement.value},
                         {"attainable", placement.attainable},
                         {"candidates", placement.candidates},
                         {"exchanges", placement.exchanges}};
    json["sensor_width_mm"] = request.placement.lens.sensor_width_mm;
    json["out"] = arguments.out;
    std::printf("%s\n", json.dump(2).c_str());
  } else {
    std::printf("%s%s: %s; lenses for a sensor %g mm wide\n",
                summary(rig, coverage, request, placement).c_str(), arguments.out.c_str(),
                ctl::count_of(std::ssize(rig), "camera").c_str(),
                request.placement.lens.sensor_width_mm);
  }
  return kExitDone;
}

void add_camera_options(cli::Command command, Arguments& arguments) {
  command.add_option("--cameras", arguments.cameras, "Number of cameras, with the fixed ones")
      .type_name("N")
      .check(cli::integer_in(1, kMaxCameras))
      .required();
  command
      .add_option("--lens", arguments.lenses,
                  "Focal lengths to choose from, for each camera, millimetres")
      .type_name("MM,...")
      .required();
  command
      .add_option("--sensor-width", arguments.sensor_width_mm,
                  "Width of the sensors, millimetres; 7.2 is a sensor of 1/1.8 inch")
      .type_name("MM")
      .check(cli::number_in(0.5, 100))
      .show_default();
  command.add_option("--size", arguments.size, "Size of the images, pixels")
      .type_name("WxH")
      .show_default();
  command
      .add_option("--fixed", arguments.fixed,
                  "Calibration file of cameras that stay where they are")
      .type_name("FILE");
}

void add_room_options(cli::Command command, Arguments& arguments) {
  command
      .add_option("--space", arguments.space,
                  "The space in which people act, metres; they stand on z = 0, or on Z0 where the "
                  "space does not contain z = 0")
      .type_name("X0,Y0,Z0,X1,Y1,Z1")
      .required();
  command
      .add_option("--mount", arguments.mounts,
                  "Where cameras can be: walls around the space, an oval rail inside the walls, "
                  "the ceiling")
      .type_name("wall,rail,ceiling")
      .show_default();
  command
      .add_option("--margin", arguments.margin, "Distance of the walls from the sides of the space")
      .type_name("LEN")
      .show_default();
  command
      .add_option("--heights", arguments.heights,
                  "Lowest and highest camera above the floor; the highest is that of the ceiling")
      .type_name("LOW:HIGH")
      .show_default();
}

void add_action_options(cli::Command command, Arguments& arguments) {
  command
      .add_option("--performer", arguments.performer, "Performers: one swordsman, or a duel of two")
      .type_name("swordsman|duel")
      .check(cli::one_of({"swordsman", "duel"}))
      .show_default();
  command
      .add_option("--moments", arguments.moments,
                  "Number of moments of the action, each at another place")
      .type_name("N")
      .check(cli::integer_in(1, 200))
      .show_default();
  command.add_option("--seed", arguments.seed, "Random seed of moments, places and points")
      .type_name("S")
      .show_default();
}

}  // namespace

void add_plan(ctl::CommandLine& line) {
  cli::Command command = line.add(
      "plan", "Propose positions and lenses of cameras for a space, and report their coverage",
      {"v3dctl plan --space=-1.5,-1.5,0,1.5,1.5,2 --cameras 15 --lens 5,6,8 --out plan.toml",
       "v3dctl plan --space=-1.5,-1.5,0,1.5,1.5,2 --cameras 18 --lens 6 --fixed calib.toml \\",
       "    --mount rail,ceiling --out more.toml --plot more.svg"});
  auto arguments = std::make_shared<Arguments>();
  add_room_options(command, *arguments);
  add_camera_options(command, *arguments);
  add_action_options(command, *arguments);
  command.add_option("--out", arguments->out, "The calibration file to write; must not exist")
      .type_name("FILE")
      .required();
  command.add_option("--plot", arguments->plot, "Write plan view and elevation as an SVG picture")
      .type_name("FILE");
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::plan
