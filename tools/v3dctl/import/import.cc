#include "v3dctl/import/import.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/camera_model.h"
#include "base/image/frame.h"
#include "base/image/image.h"
#include "base/io/file.h"
#include "capture/segmentation/segmenter.h"
#include "common/console.h"
#include "common/partial_file.h"
#include "take/ledger/ledger.h"
#include "take/ledger/take_account.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "v3dctl/import/media.h"

namespace v3d::ctl {

// Builder of complete takes from images, for the import.

/// Writes a take under a temporary name in the same folder until finish(); the destructor removes
/// an unfinished take. One thread.
class TakeBuilder {
 public:
  /// Throws InputError if `folder` exists, if its name is no take name, or if its parent is not
  /// writable.
  TakeBuilder(const std::filesystem::path& folder, std::vector<std::string> cameras, double rate_hz,
              const Rig& rig);

  /// Folder for background models.
  std::filesystem::path background() const { return paths_.background(); }
  struct Shot {
    Image image;
    std::optional<Mask> mask;
  };
  /// Adds a pulse: one image of each camera, in the order of `cameras`. Throws std::runtime_error
  /// for errors of the disk.
  void add_pulse(std::vector<Shot> shots);
  int64_t pulses() const { return pulses_; }
  /// Writes ledger and take.toml, and renames the take. Throws std::runtime_error for errors of the
  /// disk.
  void finish();

 private:
  FrameLabel label() const;

  PartialFolder partial_;
  take::TakePaths paths_;  ///< in the temporary folder
  take::TakeInfo info_;
  std::optional<take::EventLogWriter> pulse_log_;
  std::vector<take::EventLogWriter> frame_logs_;
  int64_t pulses_ = 0;
};

namespace {

namespace fs = std::filesystem;

struct CameraSource {
  const RigCamera* camera;
  std::unique_ptr<FrameSource> images;
};

void require_size(ImageSize found, ImageSize expected, const std::string& where,
                  const std::string& by) {
  if (found == expected) return;
  const bool rotated = found == ImageSize{expected.height, expected.width};
  throw InputError(where + ": is " + format_size(found) + ", but " + by + " is " +
                   format_size(expected) + (rotated ? ": it is rotated" : ""));
}

const RigCamera& camera_of(const Rig& rig, const std::string& name, const char* option,
                           const fs::path& calib) {
  const int index = find_camera(rig, name);
  if (index < 0) {
    throw InputError(std::string(option) + " " + name + "=...: no camera " + name + " in " +
                     calib.string());
  }
  return rig[static_cast<size_t>(index)];
}

std::vector<CameraSource> open_sources(const ImportOptions& options, const Rig& rig) {
  std::vector<CameraSource> sources;
  if (options.videos.empty()) {
    for (ImageSequence& sequence : find_images(options.images, options.masks, rig)) {
      const RigCamera& camera = camera_of(rig, sequence.camera, "--images", options.calib);
      sources.push_back({&camera, open_images(std::move(sequence))});
    }
    return sources;
  }
  for (const auto& [name, file] : options.videos) {
    const RigCamera& camera = camera_of(rig, name, "--video", options.calib);
    sources.push_back({&camera, open_video(file)});
  }
  return sources;
}

void note_unused_cameras(const Rig& rig, const std::vector<CameraSource>& sources) {
  std::vector<std::string> unused;
  for (const RigCamera& camera : rig) {
    const bool used = std::any_of(sources.begin(), sources.end(),
                                  [&](const CameraSource& s) { return s.camera == &camera; });
    if (!used) unused.push_back(camera.name);
  }
  if (!unused.empty()) note("calibrated cameras without images: " + join_names(unused));
}

double rate_of(const ImportOptions& options, const std::vector<CameraSource>& sources) {
  if (options.rate_hz > 0) return options.rate_hz;
  // 30 and 30000/1001 frames/s, which differ by 0.1 %, are one frame apart after 33 s.
  constexpr double kTolerance = 2e-4;
  const double rate = sources.front().images->rate_hz();
  for (const CameraSource& source : sources) {
    const double other = source.images->rate_hz();
    if (std::abs(other - rate) > kTolerance * std::max(rate, other)) {
      throw InputError(source.images->name() + ": has " + std::to_string(other) + " frames/s, " +
                       sources.front().images->name() + " has " + std::to_string(rate) +
                       "; expected --rate HZ");
    }
  }
  return rate > 0 ? rate : 25;
}

// Throws InputError with the length of each source, when one has ended and others have not.
[[noreturn]] void refuse_lengths(std::vector<CameraSource>& sources, int64_t at,
                                 const std::vector<bool>& ended) {
  std::string lengths;
  int64_t shortest = std::numeric_limits<int64_t>::max();
  for (size_t i = 0; i < sources.size(); ++i) {
    int64_t length = ended[i] ? at : at + 1;
    while (!ended[i] && sources[i].images->skip()) {
      stop_if_interrupted();
      ++length;
    }
    shortest = std::min(shortest, length);
    lengths += (i ? ", " : "") + sources[i].camera->name + " " + std::to_string(length);
  }
  throw InputError("the recordings differ in length, so frames may not match: " + lengths +
                   " frames; --frames 0:" + std::to_string(shortest) +
                   " selects the frames that all have");
}

// Advances all sources; returns false when all end together.
template <class Advance>
bool advance_all(std::vector<CameraSource>& sources, int64_t at, Advance advance) {
  std::vector<bool> ended(sources.size());
  for (size_t i = 0; i < sources.size(); ++i) ended[i] = !advance(i);
  const auto count = std::count(ended.begin(), ended.end(), true);
  if (count > 0 && count < std::ssize(ended)) refuse_lengths(sources, at, ended);
  return count == 0;
}

TakeBuilder::Shot checked_shot(const RigCamera& camera, SourceImage source,
                               const std::optional<BlackBackground>& black) {
  require_size(source.image.size, camera.model.size(), source.where,
               camera.name + " in the calibration");
  if (source.mask)
    require_size(source.mask->size(), source.image.size, source.mask_where, "its image");
  if (black) source.mask = mask_before_black(source.image.view(), *black);
  return {std::move(source.image), std::move(source.mask)};
}

void copy_images(const ImportOptions& options, std::vector<CameraSource>& sources,
                 TakeBuilder& take) {
  int64_t at = 0;
  for (; at < options.frames.begin; ++at) {
    stop_if_interrupted();
    if (!advance_all(sources, at, [&](size_t i) { return sources[i].images->skip(); })) break;
  }
  const int64_t length = sources.front().images->announced();
  Progress progress("import", std::max<int64_t>(0, std::min(length, options.frames.end) - at));
  for (; at < options.frames.end; ++at) {
    stop_if_interrupted();
    std::vector<TakeBuilder::Shot> shots(sources.size());
    const bool whole = advance_all(sources, at, [&](size_t i) {
      std::optional<SourceImage> source = sources[i].images->next();
      if (source) shots[i] = checked_shot(*sources[i].camera, *std::move(source), options.black);
      return shots[i].image.size.pixels() > 0;
    });
    if (!whole) break;
    take.add_pulse(std::move(shots));
    progress.advance();
  }
  if (take.pulses() == 0) {
    throw InputError("--frames " + std::to_string(options.frames.begin) +
                     ":...: the recordings end after " + std::to_string(at) + " frames");
  }
}

constexpr size_t kMaxPlates = 100;

/// Plates at equal distances in a video. The length that a file states may be missing or wrong, so
/// every second plate is dropped whenever there are too many.
std::vector<Image> read_plates_of_video(const fs::path& file) {
  std::vector<Image> plates;
  VideoFile video(file);
  constexpr auto kMax = static_cast<int64_t>(kMaxPlates);
  int64_t stride = std::max<int64_t>(1, (video.announced_frames() + kMax - 1) / kMax);
  for (int64_t at = 0;; ++at) {
    stop_if_interrupted();
    if (at % stride != 0) {
      if (!video.skip()) return plates;
      continue;
    }
    std::optional<Image> plate = video.next();
    if (!plate) return plates;
    if (plates.size() == kMaxPlates) {
      for (size_t i = 1; i < kMaxPlates / 2; ++i) plates[i] = std::move(plates[2 * i]);
      plates.resize(kMaxPlates / 2);
      stride *= 2;
    }
    plates.push_back(*std::move(plate));
  }
}

std::vector<Image> read_plates_of_folder(const fs::path& folder) {
  const std::vector<fs::path> files = images_in(folder);
  const size_t stride = std::max<size_t>(1, (files.size() + kMaxPlates - 1) / kMaxPlates);
  std::vector<Image> plates;
  for (size_t i = 0; i < files.size(); i += stride) {
    stop_if_interrupted();
    plates.push_back(read_image(files[i]));
  }
  return plates;
}

std::vector<Image> read_plates(const fs::path& file) {
  std::vector<Image> plates;
  if (fs::is_directory(file)) {
    plates = read_plates_of_folder(file);
  } else if (has_image_name(file)) {
    // One image does not show the noise; with two equal ones the noise floor applies.
    plates.assign(2, read_image(file));
  } else {
    plates = read_plates_of_video(file);
  }
  if (plates.empty()) throw InputError(file.string() + ": has no images of the empty studio");
  return plates;
}

void learn_backgrounds(const ImportOptions& options, const Rig& rig, const fs::path& folder) {
  for (const auto& [name, file] : options.backgrounds) {
    stop_if_interrupted();
    const RigCamera& camera = camera_of(rig, name, "--background", options.calib);
    const std::vector<Image> plates = read_plates(file);
    std::vector<ImageView> views;
    for (const Image& plate : plates) {
      require_size(plate.size, camera.model.size(), file, name + " in the calibration");
      views.push_back(plate.view());
    }
    fs::create_directories(folder);
    save_background(folder, name, segmentation::learn_background(views));
    note("background of " + name + ": " + format_count(std::ssize(plates)) + " plates");
  }
}

void require_consistent(const ImportOptions& options) {
  if (options.images.empty() == options.videos.empty()) {
    throw InputError("expected either --images DIR or --video CAM=FILE...");
  }
  if (!options.masks.empty() && options.images.empty()) {
    throw InputError("--masks: expected --images; with --video, expected --background");
  }
  if (!options.masks.empty() && options.black) {
    throw InputError("--masks and --background-black: expected one of them");
  }
}

}  // namespace

ImportResult import_take(const ImportOptions& options) {
  require_consistent(options);
  const Rig rig = load_calib(options.calib);
  for (const auto& [name, file] : options.backgrounds) {
    camera_of(rig, name, "--background", options.calib);
  }
  std::vector<CameraSource> sources = open_sources(options, rig);
  note_unused_cameras(rig, sources);
  ImportResult result;
  for (const CameraSource& source : sources) result.cameras.push_back(source.camera->name);
  result.rate_hz = rate_of(options, sources);
  TakeBuilder take(options.take, result.cameras, result.rate_hz, rig);
  learn_backgrounds(options, rig, take.background());
  copy_images(options, sources, take);
  take.finish();
  if (options.masks.empty() && options.backgrounds.empty() && !options.black) {
    note("this take cannot be reconstructed without --masks, --background or --background-black");
  }
  result.frames = take.pulses();
  return result;
}

BlackBackground parse_black_background(std::string_view text) {
  BlackBackground black;
  const char* at = text.data();
  const char* const end = at + text.size();
  auto read = [&](auto& value) {
    const auto [next, error] = std::from_chars(at, end, value);
    at = next;
    return error == std::errc{};
  };
  bool valid = read(black.level) && black.level >= 0 && black.level < 1;
  if (valid && at != end) {
    valid =
        *at++ == ':' && read(black.dilate_px) && at != end && *at++ == ':' && read(black.erode_px);
  }
  const auto in_range = [](int pixels) { return pixels >= 0 && pixels <= 100; };
  if (!valid || at != end || !in_range(black.dilate_px) || !in_range(black.erode_px)) {
    throw InputError("--background-black " + std::string(text) +
                     ": expected LEVEL or LEVEL:GROW:SHRINK, such as 0.19:10:7 (level 0 to 1, "
                     "pixels 0 to 100)");
  }
  return black;
}

namespace {

fs::path checked_folder(fs::path folder) {
  folder = normal_folder(folder);
  const std::string name = folder.filename();
  if (!is_file_name(name)) {
    throw InputError(
        folder.string() + ": '" + name +
        "' is no take name; expected up to 64 letters, digits, '-', '_' and '.', not starting "
        "with '-' or '.'");
  }
  if (fs::exists(folder)) {
    throw InputError(folder.string() + ": exists; expected another name");
  }
  return folder;
}

/// Throws InputError for a name that is too long for the channel of a log.
void reject_long_names(const std::vector<std::string>& cameras) {
  for (const std::string& camera : cameras) {
    if (camera.size() <= kMaxCameraName) continue;
    throw InputError("camera '" + camera + "' of the calibration: its name has " +
                     std::to_string(camera.size()) + " characters; expected at most " +
                     std::to_string(kMaxCameraName));
  }
}

}  // namespace

TakeBuilder::TakeBuilder(const fs::path& folder, std::vector<std::string> cameras, double rate_hz,
                         const Rig& rig)
    : partial_(checked_folder(folder)), paths_{partial_.path()} {
  reject_long_names(cameras);
  info_.name = partial_.final_path().filename();
  info_.studio = "import";
  info_.rate_hz = rate_hz;
  info_.software_version = V3D_VERSION;
  info_.started = Realtime::now();
  info_.cameras = std::move(cameras);
  save_calib(paths_.calib(), rig);
  pulse_log_.emplace(paths_.pulses());
  for (const std::string& camera : info_.cameras) frame_logs_.emplace_back(paths_.frames(camera));
}

// Imported images have no clock: pulse n is labelled n periods after the start of the import.
FrameLabel TakeBuilder::label() const {
  FrameLabel label;
  label.pulse = pulses_;
  label.camera_counter = static_cast<uint64_t>(pulses_);
  label.device_time = DeviceInstant(from_seconds(static_cast<double>(pulses_) / info_.rate_hz));
  label.received = info_.started + label.device_time.time_since_epoch();
  return label;
}

void TakeBuilder::add_pulse(std::vector<Shot> shots) {
  wire::FrameMessage message;
  message.seq = pulses_;
  message.take = info_.name;
  message.frame.label = label();
  message.sent = message.frame.label.received;
  for (size_t camera = 0; camera < shots.size(); ++camera) {
    Frame& frame = message.frame;
    frame.camera = info_.cameras[camera];
    frame.image = std::move(shots[camera].image);
    frame.mask = std::move(shots[camera].mask);
    frame.sensor_size = frame.image.size;
    frame.roi = {0, 0, frame.image.size.width, frame.image.size.height};
    io::throw_if_failed(frame_logs_[camera].write(message));
  }
  wire::PulseMessage pulse;
  pulse.sent = pulse.edge = message.sent;
  pulse.edge_monotonic = MonotonicInstant(message.frame.label.device_time.time_since_epoch());
  pulse.seq = pulse.pulse = pulses_;
  pulse.take = info_.name;
  io::throw_if_failed(pulse_log_->write(pulse));
  ++pulses_;
}

void TakeBuilder::finish() {
  std::vector<int64_t> pulses(static_cast<size_t>(pulses_));
  std::iota(pulses.begin(), pulses.end(), 0);
  take::Ledger ledger;
  ledger.take = info_.name;
  ledger.commanded = pulses_;
  ledger.sensed = pulses_;
  for (const std::string& camera : info_.cameras) {
    ledger.cameras.push_back(take::account(camera, pulses, {}, pulses_));
  }
  info_.pulses = pulses_;
  info_.state = take::TakeState::kComplete;
  for (take::EventLogWriter& log : frame_logs_) io::throw_if_failed(log.sync());
  io::throw_if_failed(pulse_log_->sync());
  for (const take::EventLogWriter& log : frame_logs_) ledger.files.push_back(log.file());
  save_account_or_throw(paths_, info_, ledger);
  partial_.finish();
}

}  // namespace v3d::ctl
