#include "v3dctl/scene/scene_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kVersion = 1;
constexpr double kMaxSeconds = 36'000;
constexpr double kMaxMetres = 1e6;
constexpr int64_t kMaxPulses = int64_t{1} << 53;

/// A JSON value and its path in the file.
class Field {
 public:
  Field(const json& value, fs::path file, std::string where)
      : value_(&value), file_(std::move(file)), where_(std::move(where)) {}

  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(file_.string() + ": " + (where_.empty() ? "" : where_ + ": ") + what);
  }

  /// Throws InputError for keys that are not in `known`.
  void expect_object(const std::set<std::string>& known) const {
    if (!value_->is_object()) refuse("expected an object");
    for (const auto& [key, value] : value_->items()) {
      if (!known.contains(key)) refuse("there is no key '" + key + "'");
    }
  }
  std::optional<Field> find(const std::string& key) const {
    const auto found = value_->find(key);
    if (found == value_->end()) return {};
    return Field(*found, file_, where_.empty() ? key : where_ + "." + key);
  }
  Field at(const std::string& key) const {
    if (auto field = find(key)) return *field;
    refuse("'" + key + "' is missing");
  }
  std::vector<Field> list() const {
    if (!value_->is_array()) refuse("expected a list");
    std::vector<Field> fields;
    for (size_t i = 0; i < value_->size(); ++i) {
      fields.emplace_back((*value_)[i], file_, where_ + "[" + std::to_string(i) + "]");
    }
    return fields;
  }

  double number(double min, double max) const {
    const double n = value_->is_number() ? value_->get<double>() : NAN;
    if (n >= min && n <= max) return n;
    refuse("expected a number from " + text_of(min) + " to " + text_of(max));
  }
  double positive() const {
    const double n = value_->is_number() ? value_->get<double>() : NAN;
    if (n > 0 && n <= 1000) return n;
    refuse("expected a number above 0, at most 1000");
  }
  int64_t pulse() const {
    const int64_t n = value_->is_number_integer() ? value_->get<int64_t>() : -1;
    if (n >= 0 && n < kMaxPulses) return n;
    refuse("expected the number of a pulse");
  }
  int performer() const {
    const int64_t n = value_->is_number_integer() ? value_->get<int64_t>() : 0;
    if (n >= 1 && n <= 255) return static_cast<int>(n);
    refuse("expected the number of a performer, 1 to 255");
  }
  bool flag() const {
    if (value_->is_boolean()) return value_->get<bool>();
    refuse("expected true or false");
  }
  std::string text() const {
    if (value_->is_string()) return value_->get<std::string>();
    refuse("expected a text");
  }
  Eigen::Vector3d vector() const {
    const std::vector<Field> parts = value_->is_array() ? list() : std::vector<Field>{};
    if (parts.size() != 3) refuse("expected three numbers, [x, y, z]");
    Eigen::Vector3d v;
    for (int k = 0; k < 3; ++k)
      v[k] = parts[static_cast<size_t>(k)].number(-kMaxMetres, kMaxMetres);
    return v;
  }
  /// Path of a file in the folder of the scene.
  fs::path path() const {
    const std::string name = text();
    if (name.empty() || name.front() == '/' || name.find_first_of(":?#\\%") != std::string::npos) {
      refuse("expected a path from the folder of the scene, without any of : ? # % and backslash");
    }
    return (file_.parent_path() / name).lexically_normal();
  }
  Rgb8 colour() const {
    const std::string name = text();
    const bool right = name.size() == 7 && name[0] == '#' &&
                       name.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos;
    if (!right) refuse("expected a colour such as \"#101216\"");
    const auto part = [&](size_t at) {
      return static_cast<uint8_t>(std::stoi(name.substr(at, 2), nullptr, 16));
    };
    return {part(1), part(3), part(5)};
  }

 private:
  static std::string text_of(double number) { return json(number).dump(); }

  const json* value_;
  fs::path file_;
  std::string where_;
};

Placement read_place(const Field& field) {
  Placement place;
  if (const auto f = field.find("move")) place.move = f->vector();
  if (const auto f = field.find("turn_deg")) place.turn_deg = f->vector();
  if (const auto f = field.find("scale")) place.scale = f->positive();
  return place;
}

Outside read_outside(const Field& field) {
  const std::string name = field.text();
  if (name == "hold") return Outside::kHold;
  if (name == "hide") return Outside::kHide;
  if (name == "loop") return Outside::kLoop;
  field.refuse("expected hold, hide or loop");
}

SceneTake read_take(const Field& field) {
  field.expect_object({"take", "move", "turn_deg", "scale", "start_s", "speed", "in_pulse",
                       "out_pulse", "outside", "performer"});
  SceneTake take{.take = field.at("take").path(), .place = read_place(field)};
  if (const auto f = field.find("start_s")) take.start_s = f->number(-kMaxSeconds, kMaxSeconds);
  if (const auto f = field.find("speed")) take.speed = f->positive();
  if (const auto f = field.find("in_pulse")) take.in_pulse = f->pulse();
  if (const auto f = field.find("out_pulse")) take.out_pulse = f->pulse();
  if (take.in_pulse && take.out_pulse && *take.out_pulse < *take.in_pulse) {
    field.at("out_pulse").refuse("expected no pulse before in_pulse");
  }
  if (const auto f = field.find("outside")) take.outside = read_outside(*f);
  if (const auto f = field.find("performer")) take.performer = f->performer();
  return take;
}

SceneModel read_model(const Field& field) {
  field.expect_object({"model", "move", "turn_deg", "scale"});
  return {.model = field.at("model").path(), .place = read_place(field)};
}

SceneBackground read_background(const Field& field) {
  field.expect_object({"colour", "image", "video", "sphere", "turn_deg"});
  SceneBackground background;
  int pictures = 0;
  const auto picture = [&](const char* key, fs::path& path) {
    if (const auto f = field.find(key)) {
      path = f->path();
      ++pictures;
    }
  };
  if (const auto f = field.find("colour")) background.colour = f->colour();
  picture("image", background.image);
  picture("video", background.video);
  picture("sphere", background.sphere);
  if (pictures > 1) field.refuse("expected one of image, video and sphere");
  if (const auto f = field.find("turn_deg")) background.turn_deg = f->number(-360, 360);
  return background;
}

CameraKey read_key(const Field& field) {
  field.expect_object({"at_s", "eye", "look", "fov_deg"});
  CameraKey key{.at_s = field.at("at_s").number(0, kMaxSeconds),
                .eye = field.at("eye").vector(),
                .look = field.at("look").vector()};
  if (const auto f = field.find("fov_deg")) key.fov_deg = f->number(1, 150);
  if ((key.look - key.eye).norm() < 1e-3) field.refuse("eye and look are the same place");
  return key;
}

std::vector<CameraKey> read_camera(const Field& field) {
  field.expect_object({"keys"});
  const Field keys = field.at("keys");
  std::vector<CameraKey> camera;
  for (const Field& key : keys.list()) {
    camera.push_back(read_key(key));
    if (camera.size() > 1 && camera[camera.size() - 2].at_s >= camera.back().at_s) {
      key.at("at_s").refuse("expected a time after that of the key before");
    }
  }
  if (camera.empty()) keys.refuse("expected at least one key");
  return camera;
}

Scene read_scene(const Field& field) {
  field.expect_object(
      {"v3d_scene", "rate_hz", "seconds", "background", "floor", "takes", "models", "camera"});
  const Field version = field.at("v3d_scene");
  if (version.number(1, 1e6) != kVersion) version.refuse("this version is not known; expected 1");
  Scene scene;
  if (const auto f = field.find("rate_hz")) scene.rate_hz = f->number(1, 240);
  scene.seconds = field.at("seconds").number(0.04, kMaxSeconds);
  if (const auto f = field.find("background")) scene.background = read_background(*f);
  if (const auto f = field.find("floor")) scene.floor = f->flag();
  if (const auto f = field.find("takes")) {
    for (const Field& take : f->list()) scene.takes.push_back(read_take(take));
  }
  if (const auto f = field.find("models")) {
    for (const Field& model : f->list()) scene.models.push_back(read_model(model));
  }
  scene.camera = read_camera(field.at("camera"));
  return scene;
}

}  // namespace

Eigen::Matrix3d Placement::rotation() const {
  const Eigen::Vector3d turn = turn_deg * std::numbers::pi / 180;
  return (Eigen::AngleAxisd(turn.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(turn.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(turn.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Affine3d Placement::world_from_own() const {
  Eigen::Affine3d world_from_own = Eigen::Affine3d::Identity();
  world_from_own.linear() = scale * rotation();
  world_from_own.translation() = move;
  return world_from_own;
}

int64_t Scene::frames() const {
  return std::max<int64_t>(1, static_cast<int64_t>(std::floor(seconds * rate_hz + 1e-6)));
}

Scene parse_scene(std::string_view text, const fs::path& path) {
  const json parsed = json::parse(text, nullptr, false);
  if (parsed.is_discarded()) throw InputError(path.string() + ": is no JSON");
  return read_scene({parsed, path, ""});
}

Scene load_scene(const fs::path& path) {
  return parse_scene(io::value_or_throw(io::read_file(path, kMaxTakeTextBytes)), path);
}

namespace {

/// Tolerance of rounding: 0.04 s at 25 Hz is pulse 1 although 0.04 * 25 may be less than 1.
constexpr double kTolerance = 1e-6;

/// Interpolated values of a key.
using Numbers = Eigen::Matrix<double, 7, 1>;

Numbers numbers_of(const CameraKey& key) {
  Numbers numbers;
  numbers << key.eye, key.look, key.fov_deg;
  return numbers;
}

CameraKey key_of(double seconds, const Numbers& numbers) {
  return {seconds, numbers.head<3>(), numbers.segment<3>(3), std::clamp(numbers[6], 1.0, 150.0)};
}

Numbers slope(std::span<const CameraKey> keys, size_t at) {
  const CameraKey& before = keys[at > 0 ? at - 1 : 0];
  const CameraKey& behind = keys[std::min(at + 1, keys.size() - 1)];
  return (numbers_of(behind) - numbers_of(before)) / (behind.at_s - before.at_s);
}

}  // namespace

CameraKey camera_at(std::span<const CameraKey> keys, double seconds) {
  if (seconds <= keys.front().at_s) return key_of(seconds, numbers_of(keys.front()));
  if (seconds >= keys.back().at_s) return key_of(seconds, numbers_of(keys.back()));
  size_t next = 1;
  while (keys[next].at_s <= seconds) ++next;
  const double span = keys[next].at_s - keys[next - 1].at_s;
  const double u = (seconds - keys[next - 1].at_s) / span;
  const double u2 = u * u, u3 = u2 * u;
  return key_of(seconds, (2 * u3 - 3 * u2 + 1) * numbers_of(keys[next - 1]) +
                             (u3 - 2 * u2 + u) * span * slope(keys, next - 1) +
                             (3 * u2 - 2 * u3) * numbers_of(keys[next]) +
                             (u3 - u2) * span * slope(keys, next));
}

CameraModel camera_model(const CameraKey& key, ImageSize size) {
  const double focal = 0.5 * size.height / std::tan(key.fov_deg * std::numbers::pi / 360);
  Eigen::Matrix3d matrix;
  matrix << focal, 0, 0.5 * (size.width - 1), 0, focal, 0.5 * (size.height - 1), 0, 0, 1;
  return {size, matrix, Distortion{}, look_at(key.eye, key.look)};
}

std::optional<int64_t> pulse_at(const SceneTake& take, double rate_hz, int64_t first, int64_t last,
                                double seconds) {
  const int64_t in = std::clamp(take.in_pulse.value_or(first), first, last);
  const int64_t out = std::clamp(take.out_pulse.value_or(last), in, last);
  const int64_t length = out - in + 1;
  const double position = (seconds - take.start_s) * take.speed * rate_hz;
  const auto n = static_cast<int64_t>(std::floor(position + kTolerance));
  switch (take.outside) {
    case Outside::kHide:
      if (n < 0 || n >= length) return {};
      break;
    case Outside::kLoop:
      return in + ((n % length) + length) % length;
    case Outside::kHold:
      break;
  }
  return in + std::clamp<int64_t>(n, 0, length - 1);
}

}  // namespace v3d::ctl
