#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "calib/rig/reports.h"
#include "calibrate/calibrate_commands.h"
#include "calibrate/colour_samples.h"
#include "common/console.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string calib;
  std::string with = "surface,floor";
  RigArguments sources;
  std::vector<std::string> dark;
  std::string out;
  std::string report;
  bool json = false;
};

/// What is used to compare the colours.
struct References {
  bool surface = false, floor = false, chart = false, grey = false;
};

References parse_references(const std::string& text) {
  References references;
  for (const std::string& word : ctl::parse_names(text, "--with")) {
    bool* const reference = word == "surface" ? &references.surface
                            : word == "floor" ? &references.floor
                            : word == "chart" ? &references.chart
                            : word == "grey"  ? &references.grey
                                              : nullptr;
    if (reference == nullptr) {
      throw InputError("--with " + word +
                       ": expected chart, grey, surface, floor or surface,floor");
    }
    *reference = true;
  }
  const int kinds = references.chart + references.grey + (references.surface || references.floor);
  if (kinds != 1)
    throw InputError("--with " + text + ": chart, grey and surface,floor cannot be combined");
  return references;
}

std::vector<NamedSource> dark_sources(const std::vector<std::string>& patterns) {
  std::vector<NamedSource> sources;
  for (const auto& [camera, pattern] : ctl::parse_camera_files(patterns, "--dark")) {
    sources.push_back({camera, open_images(pattern)});
  }
  return sources;
}

std::vector<calib::ColourSample> view_samples(const References& references,
                                              const RigSources& sources, const Rig& rig) {
  if (sources.take.empty()) {
    throw InputError("--with surface and --with floor need a take: use --take TAKE");
  }
  std::vector<calib::ColourSample> samples;
  if (references.surface) samples = surface_places(sources.take, rig, 0);
  if (references.floor) {
    const int next = samples.empty() ? 0 : samples.back().place + 1;
    const auto more = floor_places(sources.take, rig, next);
    samples.insert(samples.end(), more.begin(), more.end());
  }
  return samples;
}

struct Result {
  calib::ColourFit fit;
  std::vector<calib::ColourSample> samples;
};

/// Throws InputError for options that the comparison of surface and floor does not use.
void require_used_options(const References& references, const RigArguments& sources) {
  if (references.chart || references.grey) return;
  if (sources.live_s > 0) {
    throw InputError(
        "--live needs --with chart or grey; surface and floor need a reconstructed take: use "
        "--take TAKE");
  }
  if (sources.given.sampling.every > 0) {
    throw InputError(
        "--every chooses images of a chart or a grey card; surface and floor do not use it");
  }
}

Result fit_colours(const ctl::CommandLine& line, const Arguments& arguments, const Rig& rig) {
  const References references = parse_references(arguments.with);
  require_used_options(references, arguments.sources);
  const RigSources sources = arguments.sources.sources(line);
  calib::ColourOptions options;
  for (const RigCamera& camera : rig) options.cameras.push_back(camera.name);
  if (!arguments.dark.empty()) {
    options.black = find_black(dark_sources(arguments.dark), options.cameras);
  }
  if (references.chart) {
    auto samples = find_charts(open_sources(sources), options.cameras);
    return {fit_chart(samples, options), samples};
  }
  if (references.grey) {
    auto samples = find_grey(open_sources(sources), options.cameras);
    return {fit_grey(samples, options), samples};
  }
  auto samples = view_samples(references, sources, rig);
  return {fit_views(samples, options), samples};
}

Json to_json(const calib::ColourDifference& difference) {
  return {{"before", difference.before}, {"after", difference.after}};
}

Json to_json(const Rig& rig, const calib::ColourFit& fit) {
  Json cameras = Json::array();
  for (size_t i = 0; i < rig.size(); ++i) {
    Json matrix = Json::array();
    for (int row = 0; row < 3; ++row) {
      const Eigen::RowVector3d r = rig[i].colour.matrix.row(row);
      matrix.push_back({r[0], r[1], r[2]});
    }
    const Eigen::Vector3d& black = rig[i].colour.black;
    cameras.push_back({{"name", rig[i].name},
                       {"delta_e", to_json(fit.differences[i])},
                       {"places", fit.differences[i].places},
                       {"fitted", fit.fitted[i]},
                       {"black", {black[0], black[1], black[2]}},
                       {"matrix", matrix}});
  }
  return {{"delta_e", to_json(fit.overall)},
          {"delta_e_p90", to_json(fit.ninety_percent)},
          {"places", fit.overall.places},
          {"cameras", cameras}};
}

void print_text(const Rig& rig, const calib::ColourFit& fit) {
  size_t widest = 0;
  for (const RigCamera& camera : rig) widest = std::max(widest, camera.name.size());
  for (size_t i = 0; i < rig.size(); ++i) {
    const calib::ColourDifference& d = fit.differences[i];
    const std::string& name = rig[i].name;
    if (!fit.fitted[i]) {
      std::printf("%-*s  shares no place with another camera; keeps its colours\n",
                  static_cast<int>(widest), name.c_str());
      continue;
    }
    if (d.places == 0) {
      std::printf("%-*s  corrected, but not measured: it has no held-out place\n",
                  static_cast<int>(widest), name.c_str());
      continue;
    }
    std::printf("%-*s  Delta E %5.2f before, %5.2f after, %s\n", static_cast<int>(widest),
                name.c_str(), d.before, d.after, ctl::count_of(d.places, "place").c_str());
  }
  std::printf("colour: Delta E (CIE 2000) %.2f before, %.2f after; 90th percentile %.2f, %.2f\n",
              fit.overall.before, fit.overall.after, fit.ninety_percent.before,
              fit.ninety_percent.after);
}

void check_outputs(const Arguments& arguments) {
  ctl::check_output({"--out", arguments.out});
  ctl::check_output({"--report", arguments.report});
  ctl::require_other_file({"--report", arguments.report},
                          {{"--out", arguments.out}, {"--calib", arguments.calib}});
}

int run(const ctl::CommandLine& line, const Arguments& arguments) {
  check_outputs(arguments);
  Rig rig = load_calib(arguments.calib);
  ctl::catch_interrupts();
  Result result = fit_colours(line, arguments, rig);
  std::vector<std::string> names;
  for (size_t i = 0; i < rig.size(); ++i) {
    if (!result.fit.fitted[i]) result.fit.responses[i] = rig[i].colour;
    rig[i].colour = result.fit.responses[i];
    names.push_back(rig[i].name);
  }
  save_result(arguments.out, rig);
  if (arguments.json) {
    std::printf("%s\n", to_json(rig, result.fit).dump(2).c_str());
  } else {
    print_text(rig, result.fit);
  }
  if (!arguments.report.empty()) {
    replace_file(arguments.report, colour_report_html(names, result.fit, result.samples));
  }
  return kExitDone;
}

}  // namespace

void add_colour(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command = add_under(
      calibrate, "colour", "Give all cameras the same colour response",
      {"v3dctl calibrate colour --calib calib.toml --take kendo-07 --out calib.toml",
       "v3dctl calibrate colour --calib calib.toml --with chart --take chart-01 --out calib.toml"});
  auto arguments = std::make_shared<Arguments>();
  command.add_option("--calib", arguments->calib, "The calibrated rig")
      .type_name("FILE")
      .required();
  command
      .add_option("--with", arguments->with,
                  "What to compare: a chart with 24 patches, a grey card in the middle of the "
                  "images, the reconstructed surface of a take, the floor in its background plates")
      .type_name("chart|grey|surface,floor")
      .show_default();
  arguments->sources.add_to(command);
  command
      .add_option("--dark", arguments->dark,
                  "Images with the lens covered, for the black level; repeat for each camera")
      .type_name("CAM=GLOB");
  command.add_option("--out", arguments->out, "The rig with colour responses")
      .type_name("FILE")
      .required();
  command
      .add_option("--report", arguments->report,
                  "Also write an HTML report: colours before and after")
      .type_name("FILE.html");
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run(line, *arguments); });
}

}  // namespace v3d::calibrate
