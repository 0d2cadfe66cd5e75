#include "v3d-sim/simulated_take.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/mask_operations.h"
#include "base/io/file.h"
#include "capture/segmentation/segmenter.h"
#include "common/mesh_formats.h"
#include "sim/cameras/device_clock.h"
#include "sim/performer/skeleton.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/noise.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d::sim {
namespace {

using nlohmann::ordered_json;

void append_surface(Mesh& all, const Mesh& more) {
  const auto first = static_cast<uint32_t>(all.vertices.size());
  all.vertices.insert(all.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const auto& t : more.triangles) {
    all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
}

/// A point of the surface counts as seen up to this distance behind the nearest surface.
constexpr double kSeenToleranceM = 0.006;
constexpr size_t kTruePoints = 20'000;

/// The points as vertices; their colours state cameras and group (v3d-sim(1)).
Mesh point_cloud(const SurfacePoints& points, const Rig& rig, const std::vector<Part>& parts) {
  Mesh cloud;
  cloud.vertices = points.positions(parts);
  const std::vector<uint8_t> cameras =
      cameras_that_see(rig, parts, cloud.vertices, kSeenToleranceM);
  for (size_t i = 0; i < cameras.size(); ++i) {
    cloud.colours.push_back({cameras[i], static_cast<uint8_t>(points.groups()[i]), 0});
  }
  return cloud;
}

ordered_json to_json(const JointDefinition& joint, int first) {
  ordered_json object = {{"name", joint.name},
                         {"parent", joint.parent < 0 ? -1 : first + joint.parent}};
  if (!joint.main.empty()) object["main"] = joint.main;
  return object;
}

/// Metres, rounded to micrometres.
ordered_json to_json(const std::vector<Eigen::Vector3d>& positions) {
  auto list = ordered_json::array();
  const auto rounded = [](double metres) { return std::round(1e6 * metres) / 1e6; };
  for (const Eigen::Vector3d& p : positions) {
    list.push_back({rounded(p.x()), rounded(p.y()), rounded(p.z())});
  }
  return list;
}

}  // namespace

TakeTruth::TakeTruth(std::filesystem::path folder, Rig rig, std::vector<Performer> cast,
                     uint64_t seed)
    : folder_(std::move(folder)),
      rig_(std::move(rig)),
      cast_(std::move(cast)),
      seed_(seed),
      has_sword_(std::ranges::any_of(cast_, [](const Performer& p) { return !p.model; })) {
  std::filesystem::create_directories(folder_ / "points");
  if (has_sword_) std::filesystem::create_directory(folder_ / "sword");
  for (size_t i = 0; cast_.size() > 1 && i < cast_.size(); ++i) {
    std::filesystem::create_directory(performer_folder(i));
  }
}

std::filesystem::path TakeTruth::performer_folder(size_t index) const {
  return folder_ / fmt::format("performer{}", index + 1);
}

void TakeTruth::write(int64_t pulse, double seconds) {
  const std::string name = fmt::format("{:06}.ply", pulse);
  std::vector<Part> all;
  Mesh blades;
  PulseJoints& joints = joints_.emplace_back();
  joints.pulse = pulse;
  for (size_t i = 0; i < cast_.size(); ++i) {
    const std::vector<Part> parts = performer_parts(seconds, seed_, cast_[i]);
    if (cast_.size() > 1) write_ply(performer_folder(i) / name, outer_surface(parts, seed_));
    all.insert(all.end(), parts.begin(), parts.end());
    append_surface(blades, sword_blade(seconds, cast_[i]).mesh);
    const std::vector<Eigen::Vector3d> own = joint_positions(seconds, cast_[i]);
    joints.positions.insert(joints.positions.end(), own.begin(), own.end());
  }
  write_ply(folder_ / name, outer_surface(all, seed_));
  if (has_sword_) write_ply(folder_ / "sword" / name, blades);
  if (!points_) points_.emplace(all, kTruePoints, seed_);
  write_ply(folder_ / "points" / name, point_cloud(*points_, rig_, all));
}

void TakeTruth::write_joints() const {
  auto joints = ordered_json::array(), pulses = ordered_json::array();
  for (size_t i = 0; i < cast_.size(); ++i) {
    const auto first = static_cast<int>(joints.size());
    for (const JointDefinition& joint : joints_of(cast_[i])) {
      joints.push_back(to_json(joint, first));
      if (cast_.size() > 1) joints.back()["performer"] = i + 1;
    }
  }
  for (const PulseJoints& pulse : joints_) {
    pulses.push_back({{"pulse", pulse.pulse}, {"positions", to_json(pulse.positions)}});
  }
  const ordered_json file = {{"joints", std::move(joints)}, {"pulses", std::move(pulses)}};
  // Names in a file can be invalid UTF-8.
  io::throw_if_failed(
      io::replace_file(folder_ / "joints.json",
                       file.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n"));
}

namespace {

constexpr int kPlates = 8;
// Times of a simulated take: it starts at 2026-01-01 00:00:00 UTC, 1000 s after boot.
constexpr int64_t kStartRealtimeNs = 1'767'225'600'000'000'000;
constexpr int64_t kStartMonotonicNs = 1'000'000'000'000;
constexpr Duration kTransferTime = std::chrono::milliseconds(9);

take::TakePaths create_folder(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  const std::string name = fs::absolute(folder / ".").parent_path().filename().string();
  if (!is_file_name(name)) {
    throw InputError(folder.string() + ": '" + name +
                     "' is no take name: letters, digits, '-', '_' and '.', at most 64");
  }
  if (fs::exists(folder) && (!fs::is_directory(folder) || !fs::is_empty(folder))) {
    throw InputError(folder.string() + ": already exists; name a new or an empty folder");
  }
  fs::create_directories(folder / "background");
  return {folder};
}

/// Renders background plates and writes their models. Returns the models.
std::vector<segmentation::BackgroundModel> write_backgrounds(const take::TakePaths& paths,
                                                             const Rig& rig,
                                                             BatchRenderer& renderer) {
  std::vector<std::vector<Image>> plates;
  for (uint64_t i = 0; i < kPlates; ++i) {
    plates.push_back(renderer.render_all({}, i));
  }
  std::vector<segmentation::BackgroundModel> models(rig.size());
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t c) {
    std::vector<ImageView> views;
    for (const auto& plate : plates) {
      views.push_back(plate[c].view());
    }
    models[c] = segmentation::learn_background(views);
  });
  for (size_t c = 0; c < rig.size(); ++c) {
    save_background(paths.background(), rig[c].name, models[c]);
  }
  return models;
}

/// Writes the log of one camera, with its faults.
class CameraLog {
 public:
  CameraLog(const take::TakePaths& paths, std::string take, int index, std::string camera,
            uint64_t seed, const std::vector<Fault>& faults)
      : take_(std::move(take)),
        camera_(std::move(camera)),
        index_(index),
        seed_(seed),
        faults_(faults),
        clock_(simulated_clock(index, seed, from_ns<Monotonic>(kStartMonotonicNs))),
        writer_(paths.frames(camera_)) {}

  /// `image` and its mask are those of shown_at().
  void add(int64_t pulse, MonotonicInstant edge, RealtimeInstant edge_realtime, Image image,
           std::optional<Mask> mask) {
    if (has_fault(faults_, camera_, pulse, FaultKind::kDrop)) {
      return;
    }
    wire::FrameMessage message;
    message.take = take_;
    message.frame.camera = camera_;
    message.frame.sensor_size = image.size;
    message.frame.roi = {0, 0, image.size.width, image.size.height};
    message.frame.image = std::move(image);
    message.frame.mask = std::move(mask);
    FrameLabel& label = message.frame.label;
    label.pulse = pulse;
    label.camera_counter = static_cast<uint64_t>(pulse);
    label.device_time = clock_.at(edge + exposure_delay(index_, pulse, seed_));
    label.received = edge_realtime + kTransferTime;
    if (has_fault(faults_, camera_, pulse, FaultKind::kSuspect)) {
      label.suspect = true;
      label.camera_counter += 1;  // the cause: the counter is that of the next pulse
      suspect_.push_back(pulse);
    }
    const bool twice = has_fault(faults_, camera_, pulse, FaultKind::kDuplicate);
    for (int copy = 0; copy < (twice ? 2 : 1); ++copy) {
      message.seq = static_cast<int64_t>(pulses_.size());
      message.sent = label.received + Duration(copy);
      io::throw_if_failed(writer_.write(message));
      pulses_.push_back(pulse);
      exposures_.add(label.camera_counter);
    }
  }

  /// The image that the camera sends at this pulse; `image` is the correct one. To be called for
  /// every pulse, in order.
  Image shown_at(int64_t pulse, Image image) {
    recent_images_.push_back(std::move(image));
    if (std::ssize(recent_images_) > max_lag() + 1) recent_images_.pop_front();
    const int64_t last = std::ssize(recent_images_) - 1;
    Image shown = recent_images_[static_cast<size_t>(std::max<int64_t>(0, last - lag_at(pulse)))];
    if (has_fault(faults_, camera_, pulse, FaultKind::kBlack)) std::ranges::fill(shown.bytes, 0);
    return shown;
  }

  take::CameraLedger close(int64_t commanded) const {
    take::CameraLedger ledger = take::account(camera_, pulses_, suspect_, commanded);
    ledger.exposed = exposures_.exposed();
    return ledger;
  }
  take::TakeFile file() const { return writer_.file(); }

 private:
  bool is_late(const Fault& fault) const {
    return fault.camera == camera_ && fault.kind == FaultKind::kLate;
  }
  int64_t max_lag() const {
    int64_t lag = 0;
    for (const Fault& fault : faults_) lag = std::max(lag, is_late(fault) ? fault.pulses : 0);
    return lag;
  }
  /// How many pulses late the image at `pulse` is: as the latest of the camera's late faults up to
  /// this pulse says.
  int64_t lag_at(int64_t pulse) const {
    const Fault* last = nullptr;
    for (const Fault& fault : faults_) {
      if (!is_late(fault) || fault.pulse > pulse) continue;
      if (last == nullptr || fault.pulse > last->pulse) last = &fault;
    }
    return last == nullptr ? 0 : last->pulses;
  }

  const std::string take_;
  const std::string camera_;
  const int index_;
  const uint64_t seed_;
  const std::vector<Fault>& faults_;
  const SimulatedClock clock_;
  take::EventLogWriter writer_;
  std::vector<int64_t> pulses_;
  std::vector<int64_t> suspect_;
  take::ExposureCount exposures_;
  std::deque<Image> recent_images_;  ///< the last images, as many as a lag needs
};

/// Segments like the capture daemon, dilates the masks and adds noise to the outlines.
class NoisySegmenter {
 public:
  NoisySegmenter(const SimulatedTake& take,
                 const std::vector<segmentation::BackgroundModel>& models)
      : noise_px_(take.outline_noise_px), dilation_px_(take.mask_dilation_px), seed_(take.seed) {
    if (noise_px_ <= 0 && dilation_px_ <= 0) return;
    for (const segmentation::BackgroundModel& model : models)
      segmenters_.emplace_back(model, segmentation::SegmentOptions{});
  }
  /// Empty when the take has no masks.
  std::optional<Mask> segment(size_t camera, int64_t pulse, const Image& image) {
    if (segmenters_.empty()) return std::nullopt;
    const auto number = static_cast<uint64_t>(pulse) * segmenters_.size() + camera;
    return with_outline_noise(dilate(segmenters_[camera].segment(image.view()), dilation_px_),
                              noise_px_, mix(seed_) ^ number);
  }

 private:
  const double noise_px_;
  const int dilation_px_;
  const uint64_t seed_;
  std::vector<segmentation::Segmenter> segmenters_;
};

}  // namespace

void write_take(const SimulatedTake& take, const std::function<void(int64_t)>& progress) {
  const take::TakePaths paths = create_folder(take.folder);
  take::TakeInfo info;
  info.name = std::filesystem::absolute(take.folder / ".").parent_path().filename().string();
  info.studio = "simulated";
  info.rate_hz = take.rate_hz;
  info.software_version = V3D_VERSION;
  info.started = from_ns<Realtime>(kStartRealtimeNs);
  for (const RigCamera& camera : take.rig) {
    info.cameras.push_back(camera.name);
  }
  io::throw_if_failed(save_take_info(paths, info));
  save_calib(paths.calib(), take.rig);

  RenderOptions options;
  options.seed = take.seed;
  options.colour_spread = take.colour_spread;
  options.cast = take.cast;
  BatchRenderer renderer(take.rig, options);
  NoisySegmenter segmenter(take, write_backgrounds(paths, take.rig, renderer));
  std::vector<CameraLog> logs;
  for (size_t c = 0; c < take.rig.size(); ++c) {
    logs.emplace_back(paths, info.name, static_cast<int>(c), take.rig[c].name, take.seed,
                      take.faults);
  }
  take::EventLogWriter pulses(paths.pulses());
  std::optional<TakeTruth> truth;
  if (take.truth) truth.emplace(*take.truth, take.rig, take.cast, take.seed);
  for (int64_t pulse = 0; pulse < take.frames; ++pulse) {
    const double seconds = static_cast<double>(pulse) / take.rate_hz;
    const Duration since = from_seconds(seconds);
    const MonotonicInstant edge = from_ns<Monotonic>(kStartMonotonicNs) + since;
    const RealtimeInstant edge_realtime = from_ns<Realtime>(kStartRealtimeNs) + since;
    io::throw_if_failed(pulses.write(
        wire::PulseMessage{edge_realtime, pulse, info.name, pulse, edge_realtime, edge}));
    const double action_s = take.begin_s + seconds;
    std::vector<Image> images =
        renderer.render_all(action_s, static_cast<uint64_t>(kPlates + pulse));
    for (size_t c = 0; c < images.size(); ++c) {
      Image shown = logs[c].shown_at(pulse, std::move(images[c]));
      std::optional<Mask> mask = segmenter.segment(c, pulse, shown);
      logs[c].add(pulse, edge, edge_realtime, std::move(shown), std::move(mask));
    }
    if (truth) truth->write(pulse, action_s);
    progress(pulse + 1);
  }
  if (truth) truth->write_joints();

  take::Ledger ledger;
  ledger.take = info.name;
  ledger.commanded = take.frames;
  ledger.sensed = take.frames;
  for (const CameraLog& log : logs) {
    ledger.cameras.push_back(log.close(take.frames));
    ledger.files.push_back(log.file());
  }
  info.pulses = take.frames;
  info.state = take::TakeState::kComplete;
  save_account_or_throw(paths, info, ledger);
}

}  // namespace v3d::sim
