#include "v3dctl/scene/scene_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/core/error.h"
#include "base/io/file.h"
#include "v3dctl/json_field.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kVersion = 1;
constexpr double kMaxSeconds = 36'000;

Placement read_place(const JsonField& field) {
  Placement place;
  if (const auto f = field.find("move")) place.move = f->vector();
  if (const auto f = field.find("turn_deg")) place.turn_deg = f->vector();
  if (const auto f = field.find("scale")) place.scale = f->positive();
  return place;
}

Outside read_outside(const JsonField& field) {
  const std::string name = field.text();
  if (name == "hold") return Outside::kHold;
  if (name == "hide") return Outside::kHide;
  if (name == "loop") return Outside::kLoop;
  field.fail("expected hold, hide or loop");
}

SceneTake read_take(const JsonField& field) {
  field.expect_object({"take", "move", "turn_deg", "scale", "start_s", "speed", "in_pulse",
                       "out_pulse", "outside", "performer", "sound", "sound_shift_s",
                       "sound_gain_db"});
  SceneTake take{.take = field.at("take").path("scene"), .place = read_place(field)};
  if (const auto f = field.find("start_s")) take.start_s = f->number(-kMaxSeconds, kMaxSeconds);
  if (const auto f = field.find("speed")) take.speed = f->positive();
  if (const auto f = field.find("in_pulse")) take.in_pulse = f->pulse();
  if (const auto f = field.find("out_pulse")) take.out_pulse = f->pulse();
  if (take.in_pulse && take.out_pulse && *take.out_pulse < *take.in_pulse) {
    field.at("out_pulse").fail("expected no pulse before in_pulse");
  }
  if (const auto f = field.find("outside")) take.outside = read_outside(*f);
  if (const auto f = field.find("performer")) take.performer = f->performer();
  if (const auto f = field.find("sound")) take.sound = f->flag();
  if (const auto f = field.find("sound_shift_s")) take.sound_shift_s = f->number(-10, 10);
  if (const auto f = field.find("sound_gain_db")) take.sound_gain_db = f->number(-60, 24);
  return take;
}

SceneModel read_model(const JsonField& field) {
  field.expect_object({"model", "move", "turn_deg", "scale"});
  return {.model = field.at("model").path("scene"), .place = read_place(field)};
}

SceneBackground read_background(const JsonField& field) {
  field.expect_object({"colour", "image", "video", "sphere", "turn_deg"});
  SceneBackground background;
  int pictures = 0;
  const auto picture = [&](const char* key, fs::path& path) {
    if (const auto f = field.find(key)) {
      path = f->path("scene");
      ++pictures;
    }
  };
  if (const auto f = field.find("colour")) background.colour = f->colour();
  picture("image", background.image);
  picture("video", background.video);
  picture("sphere", background.sphere);
  if (pictures > 1) field.fail("expected one of image, video and sphere");
  if (const auto f = field.find("turn_deg")) background.turn_deg = f->number(-360, 360);
  return background;
}

CameraKey read_key(const JsonField& field) {
  field.expect_object({"at_s", "eye", "look", "fov_deg"});
  CameraKey key{.at_s = field.at("at_s").number(0, kMaxSeconds),
                .eye = field.at("eye").vector(),
                .look = field.at("look").vector()};
  if (const auto f = field.find("fov_deg")) key.fov_deg = f->number(1, 150);
  if ((key.look - key.eye).norm() < 1e-3) field.fail("eye and look are the same place");
  return key;
}

std::vector<CameraKey> read_camera(const JsonField& field) {
  field.expect_object({"keys"});
  const JsonField keys = field.at("keys");
  std::vector<CameraKey> camera;
  for (const JsonField& key : keys.list()) {
    camera.push_back(read_key(key));
    if (camera.size() > 1 && camera[camera.size() - 2].at_s >= camera.back().at_s) {
      key.at("at_s").fail("expected a time after that of the key before");
    }
  }
  if (camera.empty()) keys.fail("expected at least one key");
  return camera;
}

Scene read_scene(const JsonField& field) {
  field.expect_object(
      {"v3d_scene", "rate_hz", "seconds", "background", "floor", "takes", "models", "camera"});
  const JsonField version = field.at("v3d_scene");
  if (version.number(1, 1e6) != kVersion) version.fail("this version is not known; expected 1");
  Scene scene;
  if (const auto f = field.find("rate_hz")) scene.rate_hz = f->number(1, 240);
  scene.seconds = field.at("seconds").number(0.04, kMaxSeconds);
  if (const auto f = field.find("background")) scene.background = read_background(*f);
  if (const auto f = field.find("floor")) scene.floor = f->flag();
  if (const auto f = field.find("takes")) {
    for (const JsonField& take : f->list()) scene.takes.push_back(read_take(take));
  }
  if (const auto f = field.find("models")) {
    for (const JsonField& model : f->list()) scene.models.push_back(read_model(model));
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

TakePart part_of(const SceneTake& take, int64_t first, int64_t last) {
  const int64_t in = std::clamp(take.in_pulse.value_or(first), first, last);
  const int64_t out = std::clamp(take.out_pulse.value_or(last), in, last);
  return {.in = in, .length = out - in + 1};
}

std::optional<int64_t> pulse_at(const SceneTake& take, double rate_hz, int64_t first, int64_t last,
                                double seconds) {
  const auto [in, length] = part_of(take, first, last);
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
