#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/core/units.h"
#include "base/image/image_size.h"
#include "calib/formats/foreign_rig.h"
#include "calibrate/commands.h"
#include "calibrate/rig_formats.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string in;
  std::string out;
  std::string from;
  std::string to;
  std::string size;
  std::string unit = "1m";
  std::string up = "z";
  bool json = false;
};

/// The format given by the option, else the one that the path implies.
RigFormat format_of(const std::string& named, const std::string& option, const std::string& path) {
  if (!named.empty()) return parse_rig_format(named, option);
  const auto detected = detect_rig_format(path);
  if (!detected) {
    throw InputError(path + ": unknown format; use " + option +
                     " toml, opencv, opencv-xml, colmap or middlebury");
  }
  return *detected;
}

std::optional<ImageSize> size_of(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(parse_size(text));
}

/// The largest distance between two cameras, metres. It shows a wrong unit.
double extent_of(const Rig& rig) {
  double largest = 0;
  for (const RigCamera& a : rig) {
    for (const RigCamera& b : rig) {
      largest = std::max(largest, (a.model.center() - b.model.center()).norm());
    }
  }
  return largest;
}

Json to_json(const Rig& rig, RigFormat from, RigFormat to,
             const std::vector<std::filesystem::path>& written) {
  Json cameras = Json::array(), files = Json::array();
  for (const RigCamera& camera : rig) cameras.push_back(camera.name);
  for (const auto& file : written) files.push_back(file.string());
  return {{"from", name(from)},
          {"to", name(to)},
          {"cameras", cameras},
          {"extent_m", extent_of(rig)},
          {"files", files}};
}

int run(const Arguments& arguments) {
  const RigFormat from = format_of(arguments.from, "--from", arguments.in);
  const RigFormat to = format_of(arguments.to, "--to", arguments.out);
  const Rig rig = calib::metric_rig(load_rig({arguments.in, from, size_of(arguments.size)}),
                                    parse_length(arguments.unit), arguments.up);
  const auto written = save_rig(arguments.out, to, rig);
  if (arguments.json) {
    std::printf("%s\n", to_json(rig, from, to, written).dump(2).c_str());
    return kExitDone;
  }
  std::printf("%s: %s", arguments.out.c_str(), ctl::count_of(std::ssize(rig), "camera").c_str());
  if (extent_of(rig) == 0) {
    std::printf(", lenses only");
  } else {
    std::printf(", largest distance %s", format_length(extent_of(rig)).c_str());
  }
  std::printf("\n");
  return kExitDone;
}

constexpr char kFormats[] = "toml, opencv, opencv-xml, colmap or middlebury";

}  // namespace

void add_convert(ctl::CommandLine& line, CLI::App* calibrate) {
  CLI::App* command = add_under(
      calibrate, "convert", "Convert calibrations from and to the formats of other programs",
      {"v3dctl calibrate convert sparse/0 calib.toml --unit 1.37m --up -y",
       "v3dctl calibrate convert 'cam*/config.xml' calib.toml --size 644x486 --unit 1mm",
       "v3dctl calibrate convert dinoSR_par.txt calib.toml --size 640x480",
       "v3dctl calibrate convert calib.toml colmap --to colmap"});
  auto arguments = std::make_shared<Arguments>();
  command
      ->add_option("IN", arguments->in,
                   "calib.toml of aniposelib or Pose2Sim, OpenCV's .yml or .xml of one camera (a "
                   "folder or a quoted pattern for several), COLMAP's folder with cameras.txt and "
                   "images.txt, Middlebury's _par.txt")
      ->required();
  command->add_option("OUT", arguments->out, "The file to write; a folder for opencv and colmap")
      ->required();
  command->add_option("--from", arguments->from, std::string("Format of IN: ") + kFormats)
      ->type_name("FORMAT");
  command->add_option("--to", arguments->to, std::string("Format of OUT: ") + kFormats)
      ->type_name("FORMAT");
  command->add_option("--size", arguments->size, "Size of the images, where IN does not contain it")
      ->type_name("WxH");
  command->add_option("--unit", arguments->unit, "Length of one unit of IN, such as 1mm")
      ->type_name("LEN")
      ->capture_default_str();
  command->add_option("--up", arguments->up, "The upward axis of IN's world: x, -x, y, -y, z, -z")
      ->type_name("AXIS")
      ->capture_default_str();
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::calibrate
