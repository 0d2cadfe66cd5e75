#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/camera_model.h"
#include "base/image/image.h"
#include "base/io/file.h"
#include "calib/formats/opencv_file.h"
#include "calib/formats/rig_text.h"
#include "calibrate/calibrate_commands.h"
#include "calibrate/calibration_images.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {

// Files of calibrations in the formats of several programs.

enum class RigFormat {
  kToml,        ///< calib.toml of V3D, aniposelib, Pose2Sim; camera_array.toml (read only)
  kOpencv,      ///< YAML of OpenCV, one file per camera
  kOpencvXml,   ///< XML of OpenCV, one file per camera
  kColmap,      ///< a folder with cameras.txt and images.txt
  kMiddlebury,  ///< _par.txt
};
std::string_view name(RigFormat format);
/// "toml", "opencv", "opencv-xml", "colmap", "middlebury". Throws InputError, with `option` in
/// front.
RigFormat parse_rig_format(std::string_view text, std::string_view option);

/// The format that the name of the path or the content of the folder implies; empty where unknown.
std::optional<RigFormat> detect_rig_format(const std::filesystem::path& path);

struct RigFile {
  std::string path;  ///< a file; colmap: a folder; opencv: also a folder or a pattern
  RigFormat format = RigFormat::kToml;
  std::optional<ImageSize> size;  ///< for formats without an image size
};

/// Throws InputError with the file and the error.
Rig load_rig(const RigFile& file);

/// Writes the rig in `format` and returns the written files.
///
/// For opencv and colmap, `path` is a folder, which is created where needed; for opencv it may be a
/// file where the rig has one camera. Throws InputError for a rig that the format does not support,
/// and for a folder whose points3D.txt has points, before anything is written.
std::vector<std::filesystem::path> save_rig(const std::filesystem::path& path, RigFormat format,
                                            const Rig& rig);

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

/// Throws InputError where parse_calib() would reject the written rig.
void require_readable(const Rig& rig, const Arguments& arguments) {
  constexpr double kMaxDistanceM = 1e6;  // of parse_calib()
  double distance_m = 0;
  for (const RigCamera& camera : rig) {
    distance_m = std::max(distance_m, camera.model.center().norm());
  }
  if (distance_m > kMaxDistanceM) {
    throw InputError(arguments.in + ": a camera is " + format_length(distance_m) +
                     " from the origin of the world; move the origin to the space first, or check "
                     "--unit " +
                     arguments.unit);
  }
  try {
    parse_calib(calib_text(rig), arguments.out);
  } catch (const InputError& error) {
    throw InputError(arguments.in + ": calib.toml cannot hold this rig: " + error.what());
  }
}

int run(const Arguments& arguments) {
  const RigFormat from = format_of(arguments.from, "--from", arguments.in);
  const RigFormat to = format_of(arguments.to, "--to", arguments.out);
  const bool opencv = to == RigFormat::kOpencv || to == RigFormat::kOpencvXml;
  if (opencv && std::filesystem::path(arguments.out).extension() == ".json") {
    throw InputError(arguments.out + ": OpenCV files are written as .yml, .yaml or .xml");
  }
  const Rig rig =
      calib::metric_rig(load_rig({arguments.in, from, size_of(arguments.size)}),
                        ctl::parse_length_option(arguments.unit, "--unit"), arguments.up);
  if (to == RigFormat::kToml) require_readable(rig, arguments);
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

void add_convert(ctl::CommandLine& line, cli::Command calibrate) {
  cli::Command command = add_under(
      calibrate, "convert", "Convert calibrations from and to the formats of other programs",
      {"v3dctl calibrate convert sparse/0 calib.toml --unit 1.37m --up -y",
       "v3dctl calibrate convert 'cam*/config.xml' calib.toml --size 644x486 --unit 1mm",
       "v3dctl calibrate convert dinoSR_par.txt calib.toml --size 640x480",
       "v3dctl calibrate convert calib.toml colmap --to colmap"});
  auto arguments = std::make_shared<Arguments>();
  command
      .add_option("IN", arguments->in,
                  "calib.toml of aniposelib or Pose2Sim, OpenCV's .yml or .xml of one camera (a "
                  "folder or a quoted pattern for several), COLMAP's folder with cameras.txt and "
                  "images.txt, Middlebury's _par.txt")
      .required();
  command.add_option("OUT", arguments->out, "The file to write; a folder for opencv and colmap")
      .required();
  command.add_option("--from", arguments->from, std::string("Format of IN: ") + kFormats)
      .type_name("FORMAT");
  command.add_option("--to", arguments->to, std::string("Format of OUT: ") + kFormats)
      .type_name("FORMAT");
  command.add_option("--size", arguments->size, "Size of the images, where IN does not contain it")
      .type_name("WxH");
  command.add_option("--unit", arguments->unit, "Length of one unit of IN, such as 1mm")
      .type_name("LEN")
      .show_default();
  command.add_option("--up", arguments->up, "The upward axis of IN's world: x, -x, y, -y, z, -z")
      .type_name("AXIS")
      .show_default();
  ctl::add_json_flag(command, arguments->json);
  line.on_run(command, [arguments] { return run(*arguments); });
}

namespace {

namespace fs = std::filesystem;

struct FormatName {
  RigFormat format;
  std::string_view name;
};
constexpr std::array<FormatName, 5> kNames = {{{RigFormat::kToml, "toml"},
                                               {RigFormat::kOpencv, "opencv"},
                                               {RigFormat::kOpencvXml, "opencv-xml"},
                                               {RigFormat::kColmap, "colmap"},
                                               {RigFormat::kMiddlebury, "middlebury"}}};

bool is_opencv_name(const fs::path& file) {
  constexpr std::array kEndings = {".yml", ".yaml", ".xml", ".json"};
  return std::ranges::find(kEndings, file.extension().string()) != kEndings.end();
}

/// The files of a pattern, or all OpenCV files of a folder.
std::vector<fs::path> opencv_files(const std::string& path) {
  const bool folder = fs::is_directory(path);
  std::vector<fs::path> files = matching_files(folder ? path + "/*" : path);
  if (folder) std::erase_if(files, [](const fs::path& file) { return !is_opencv_name(file); });
  if (files.empty()) {
    throw InputError(path + (folder ? ": contains no .yml, .yaml, .xml or .json file"
                                    : ": no such file (quote a pattern: 'cam*/config.xml')"));
  }
  return files;
}

Rig load_opencv(const RigFile& file) {
  const std::vector<fs::path> files = opencv_files(file.path);
  const std::vector<std::string> names = calib::camera_names(files, file.path);
  Rig rig;
  for (size_t i = 0; i < files.size(); ++i) {
    for (RigCamera& camera :
         calib::parse_opencv(io::value_or_throw(io::read_file(files[i], kMaxTakeTextBytes)),
                             {names[i], file.size}, files[i])) {
      if (find_camera(rig, camera.name) >= 0) {
        throw InputError(files[i].string() + ": duplicate camera " + camera.name);
      }
      rig.push_back(std::move(camera));
    }
  }
  return rig;
}

Rig load_colmap(const fs::path& folder) {
  return calib::parse_colmap({read_file(folder / "cameras.txt"), read_file(folder / "images.txt")},
                             folder);
}

Rig load_middlebury(const RigFile& file) {
  if (!file.size) {
    throw InputError(file.path + ": does not contain the image size; use --size WIDTHxHEIGHT");
  }
  return calib::parse_middlebury(read_file(file.path), *file.size, file.path);
}

using NamedTexts = std::vector<std::pair<fs::path, std::string>>;

NamedTexts opencv_texts(const fs::path& path, RigFormat format, const Rig& rig) {
  const bool xml = format == RigFormat::kOpencvXml || path.extension() == ".xml";
  const auto kind = xml ? calib::OpencvFormat::kXml : calib::OpencvFormat::kYaml;
  NamedTexts texts;
  for (const RigCamera& camera : rig) {
    const fs::path file = camera.name + (xml ? ".xml" : ".yml");
    texts.emplace_back(is_opencv_name(path) ? path : path / file, opencv_text(camera, kind));
  }
  if (is_opencv_name(path) && rig.size() > 1) {
    throw InputError(path.string() + ": an OpenCV file contains one camera, but there are " +
                     std::to_string(rig.size()) + "; use a folder and --to opencv");
  }
  return texts;
}

/// True where a text of COLMAP has a line that is no comment.
bool has_entries(const std::string& text) {
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line.front() != '#') return true;
  }
  return false;
}

NamedTexts colmap_texts(const fs::path& folder, const Rig& rig) {
  const fs::path points = folder / "points3D.txt";
  if (fs::exists(points) && has_entries(read_file(points))) {
    throw InputError(points.string() + ": has the points of another model; use another folder");
  }
  calib::ColmapText text = calib::colmap_text(rig);
  return {{folder / "cameras.txt", std::move(text.cameras)},
          {folder / "images.txt", std::move(text.images)},
          {points, "# none; COLMAP requires the file\n"}};
}

NamedTexts texts_of(const fs::path& path, RigFormat format, const Rig& rig) {
  switch (format) {
    case RigFormat::kOpencv:
    case RigFormat::kOpencvXml:
      return opencv_texts(path, format, rig);
    case RigFormat::kColmap:
      return colmap_texts(path, rig);
    default:
      return {{path, calib::middlebury_text(rig)}};
  }
}

}  // namespace

std::string_view name(RigFormat format) {
  return std::ranges::find(kNames, format, &FormatName::format)->name;
}

RigFormat parse_rig_format(std::string_view text, std::string_view option) {
  const auto* found = std::ranges::find(kNames, text, &FormatName::name);
  if (found == kNames.end()) {
    throw InputError(std::string(option) + " " + std::string(text) +
                     ": expected toml, opencv, opencv-xml, colmap or middlebury");
  }
  return found->format;
}

std::optional<RigFormat> detect_rig_format(const fs::path& path) {
  if (path.extension() == ".toml") return RigFormat::kToml;
  if (is_opencv_name(path)) {
    return path.extension() == ".xml" ? RigFormat::kOpencvXml : RigFormat::kOpencv;
  }
  if (path.filename().string().ends_with("_par.txt")) return RigFormat::kMiddlebury;
  if (fs::exists(path / "cameras.txt")) return RigFormat::kColmap;
  if (fs::is_directory(path) && std::any_of(fs::directory_iterator(path), {}, is_opencv_name)) {
    return RigFormat::kOpencv;
  }
  return std::nullopt;
}

Rig load_rig(const RigFile& file) {
  switch (file.format) {
    case RigFormat::kToml:
      return load_calib(file.path);
    case RigFormat::kOpencv:
    case RigFormat::kOpencvXml:
      return load_opencv(file);
    case RigFormat::kColmap:
      return load_colmap(file.path);
    case RigFormat::kMiddlebury:
      return load_middlebury(file);
  }
  return {};
}

std::vector<fs::path> save_rig(const fs::path& path, RigFormat format, const Rig& rig) {
  if (format == RigFormat::kToml) {
    save_calib(path, rig);
    return {path};
  }
  std::vector<fs::path> written;
  for (const auto& [file, text] : texts_of(path, format, rig)) {
    if (!file.parent_path().empty()) fs::create_directories(file.parent_path());
    replace_file(file, text);
    written.push_back(file);
  }
  return written;
}

}  // namespace v3d::calibrate
