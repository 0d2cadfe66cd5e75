#include "v3dctl/reconstruct/reconstruct_options.h"

#include <algorithm>
#include <charconv>
#include <string>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "codec/frame_header.h"
#include "take/logs/mesh_file.h"
#include "take/logs/repaired_pulses.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

[[noreturn]] void fail(const std::string& part) {
  throw InputError("--deform " + part +
                   ": expected NAME=VALUE of mode (search or paper), internal, photometric, "
                   "silhouette, window, views, carving (0 or 1)");
}

template <class Number>
Number number_of(const std::string& value, const std::string& part) {
  Number number{};
  const char* end = value.data() + value.size();
  const auto [stop, error] = std::from_chars(value.data(), end, number);
  if (error != std::errc{} || stop != end) fail(part);
  return number;
}

void set_value(recon::DeformOptions& options, const std::string& part) {
  const size_t equals = part.find('=');
  if (equals == std::string::npos) fail(part);
  const std::string name = part.substr(0, equals), value = part.substr(equals + 1);
  if (name == "mode" && value == "search") {
    options.mode = recon::DeformMode::kSearch;
  } else if (name == "mode" && value == "paper") {
    options.mode = recon::DeformMode::kPaper;
  } else if (name == "internal") {
    options.internal = number_of<double>(value, part);
  } else if (name == "photometric") {
    options.photometric = number_of<double>(value, part);
  } else if (name == "silhouette") {
    options.silhouette = number_of<double>(value, part);
  } else if (name == "window") {
    options.window = number_of<int>(value, part);
  } else if (name == "views") {
    options.views = number_of<int>(value, part);
  } else if ((name == "carving" || name == "hollows") && (value == "0" || value == "1")) {
    // hollows: the former name
    options.carve_concavities = value == "1";
  } else {
    fail(part);
  }
}

}  // namespace

namespace {

void add_repair_options(cli::Command& command, ReconstructArguments& arguments) {
  cli::Option repair = command.add_flag(
      "--repair", arguments.request.repair,
      "First repair silhouettes by comparing all cameras: fill missing pieces, remove "
      "phantom pieces, leave out cameras that are mostly wrong");
  command
      .add_option("--repair-pulses", arguments.repair_pulses,
                  "Repair the silhouettes of these frames alone, to the same bytes as v3d-recond; "
                  "live: those that it repaired in this take")
      .type_name("live|N,A:B,...")
      .excludes(repair);
}

void add_proxy_options(cli::Command& command, ReconstructArguments& arguments) {
  cli::Option proxy =
      command
          .add_option("--proxy", arguments.proxy,
                      "Also make proxy.v3d in the same run: the same pulses with these larger "
                      "voxels, for previews and slow PCs")
          .type_name("LEN");
  command
      .add_option("--proxy-quality", arguments.proxy_quality,
                  "Quality of the proxy (otherwise that of the mesh), not higher than --quality")
      .type_name("live|medium|high")
      .needs(proxy);
}

}  // namespace

void add_reconstruct_options(cli::Command command, ReconstructArguments& arguments) {
  command.add_option("TAKE", arguments.request.take, "The folder of the take").required();
  command
      .add_option("--voxel", arguments.voxel,
                  "Edge of a voxel with its unit (otherwise the studio's, otherwise 10mm)")
      .type_name("LEN");
  command
      .add_option(
          "--bounds", arguments.bounds,
          "The space to reconstruct, metres (otherwise the studio's, otherwise the space that "
          "half the cameras see)")
      .type_name("X0,Y0,Z0,X1,Y1,Z1");
  command
      .add_option(
          "--min-views", arguments.min_views,
          "Space that fewer cameras see is empty (otherwise the studio's, otherwise 4; with few "
          "cameras all but one)")
      .type_name("K")
      .check(cli::integer_in(1, 1000));
  command
      .add_option("--quality", arguments.quality,
                  "live: the visual hull; medium: deformed within the live budget; high: slower "
                  "and finer (otherwise the studio's, otherwise live)")
      .type_name("live|medium|high");
  add_proxy_options(command, arguments);
  command
      .add_option("--passes", arguments.passes,
                  "With medium quality: 1 coarse depth search; 2 also a fine one; 3 also removes "
                  "self-intersections; 0 the visual hull; live: as many as v3d-recond had time for "
                  "(otherwise 2)")
      .type_name("N|live");
  command
      .add_option(
          "--deform", arguments.deform,
          "With high quality: mode=search|paper, the weights of the forces internal=0.3, "
          "photometric=0.4, silhouette=0.3, window=5 samples a side, views=6 cameras at a vertex, "
          "carving=1 to carve concavities first")
      .type_name("NAME=VALUE,...");
  command.add_flag("--no-smoothing", arguments.no_smoothing,
                   "With high quality: reconstruct every frame alone, without temporal smoothing");
  add_repair_options(command, arguments);
  // Former names, not in the help.
  command.add_flag("--no-steady", arguments.no_smoothing).hide();
  command.add_flag("--mend", arguments.request.repair).hide();
  add_frames_option(command, arguments.frames);
  command
      .add_option("--threads", arguments.request.threads,
                  "Worker threads (otherwise one per core); the result is the same")
      .type_name("N")
      .check(cli::integer_in(1, 1024));
  add_task_options(command, arguments.tasks);
  command
      .add_option("--leave-out", arguments.leave_out,
                  "Cameras to leave out, for a comparison by evaluate --held-out")
      .type_name("CAM,...");
  add_json_flag(command, arguments.json);
}

ReconstructRequest request_of(const CommandLine& line, const ReconstructArguments& arguments) {
  ReconstructRequest request = arguments.request;
  if (!arguments.voxel.empty()) request.voxel_m = parse_length(arguments.voxel);
  if (!arguments.bounds.empty()) request.bounds = parse_bounds(arguments.bounds);
  if (!arguments.quality.empty()) request.quality = parse_quality(arguments.quality, "--quality");
  if (!arguments.proxy.empty()) request.proxy_voxel_m = parse_length(arguments.proxy);
  if (!arguments.proxy_quality.empty()) {
    request.proxy_quality = parse_quality(arguments.proxy_quality, "--proxy-quality");
  }
  if (!arguments.deform.empty()) request.deform = parse_deform(arguments.deform);
  if (!arguments.passes.empty()) parse_passes(arguments.passes, {request.take}, request);
  if (arguments.min_views > 0) request.min_views = arguments.min_views;
  request.smooth = !arguments.no_smoothing;
  request.frames = parse_frame_range(arguments.frames);
  if (!arguments.repair_pulses.empty()) {
    request.repair_pulses = parse_repair_pulses(arguments.repair_pulses, {request.take});
  }
  request.leave_out = parse_names(arguments.leave_out, "--leave-out");
  request.studio = line.studio_of_take(request.take);
  return request;
}

std::vector<int64_t> parse_repair_pulses(std::string_view text, const take::TakePaths& take) {
  if (text == "live") return take::read_repaired_pulses(take);
  std::vector<int64_t> pulses;
  for (const std::string& part : parse_names(text, "--repair-pulses")) {
    const take::FrameRange range = parse_frame_range(part, "--repair-pulses");
    if (range.end > take::kMaxPulses) {
      throw InputError("--repair-pulses " + part + ": expected frames below " +
                       std::to_string(take::kMaxPulses));
    }
    for (int64_t pulse = range.begin; pulse < range.end; ++pulse) pulses.push_back(pulse);
  }
  std::ranges::sort(pulses);
  pulses.erase(std::unique(pulses.begin(), pulses.end()), pulses.end());
  return pulses;
}

namespace {

std::map<int64_t, int> passes_of_meshes(const std::filesystem::path& path) {
  take::MeshFileReader meshes(path);
  std::map<int64_t, int> passes;
  bool is_deformed = false;
  for (const int64_t pulse : meshes.pulses()) {
    const auto compact = io::value_or_throw(meshes.read(pulse));
    const auto header = compact ? codec::read_header(*compact) : std::nullopt;
    if (!header) continue;
    passes[pulse] = header->metadata.live_passes;
    is_deformed = is_deformed || header->metadata.live_passes > 0;
  }
  if (!is_deformed) {
    throw InputError("--passes live: " + path.string() +
                     " has no mesh of medium quality; expected a number of passes, 0 to " +
                     std::to_string(recon::kLivePasses));
  }
  return passes;
}

}  // namespace

void parse_passes(std::string_view text, const take::TakePaths& take, ReconstructRequest& request) {
  if (text == "live") {
    request.pulse_passes = passes_of_meshes(take.mesh());
    return;
  }
  const bool is_number = text.size() == 1 && text[0] >= '0' && text[0] <= '0' + recon::kLivePasses;
  if (!is_number) {
    throw InputError("--passes " + std::string(text) + ": expected live or 0 to " +
                     std::to_string(recon::kLivePasses));
  }
  request.live_passes = text[0] - '0';
}

recon::DeformOptions parse_deform(std::string_view text) {
  recon::DeformOptions options;
  for (const std::string& part : parse_names(text, "--deform")) set_value(options, part);
  check(options);
  return options;
}

}  // namespace v3d::ctl
