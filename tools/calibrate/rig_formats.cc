#include "calibrate/rig_formats.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/whole_file.h"
#include "calib/formats/colmap_text.h"
#include "calib/formats/foreign_rig.h"
#include "calib/formats/middlebury_par.h"
#include "calib/formats/opencv_file.h"
#include "calibrate/image_source.h"

namespace v3d::calibrate {
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

NamedTexts colmap_texts(const fs::path& folder, const Rig& rig) {
  calib::ColmapText text = calib::colmap_text(rig);
  return {{folder / "cameras.txt", std::move(text.cameras)},
          {folder / "images.txt", std::move(text.images)},
          {folder / "points3D.txt", "# none; COLMAP requires the file\n"}};
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
