#include "calibrate/calibration_images.h"

#include <glob.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <memory>
#include <stdexcept>
#include <vector>

#include "base/core/error.h"
#include "base/image/image.h"
#include "common/console.h"
#include "common/natural_order.h"
#include "daemon/control/operator_client.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "v3dctl/import/media.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/operate/short_train.h"
#include "v3dctl/options.h"
#include "v3dctl/takes/collect.h"

namespace v3d::calibrate {
namespace {

namespace fs = std::filesystem;

/// Chooses runs of `run` frames, one of `stride` frames on average.
struct FrameChoice {
  int64_t stride = 1;
  int64_t run = 1;
  bool has(int64_t frame) const { return frame % (stride * run) < run; }
};

/// `frames`: the largest number of frames of a camera.
FrameChoice choice_of(int64_t frames, const Sampling& sampling) {
  if (sampling.every > 0) return {sampling.every, sampling.run};
  const int64_t most = sampling.max_images;
  return {std::max<int64_t>(1, (frames + most - 1) / most), sampling.run};
}

std::string frame_name(int64_t number) { return "frame " + std::to_string(number); }

}  // namespace

std::vector<fs::path> matching_files(const std::string& pattern) {
  glob_t found{};
  glob(pattern.c_str(), GLOB_TILDE, nullptr, &found);
  std::vector<fs::path> files(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  globfree(&found);
  std::ranges::sort(files, is_before_by_numbers);
  return files;
}

namespace {

/// Reads the chosen frames of a video.
class VideoFrames {
 public:
  VideoFrames(ctl::VideoFile video, FrameChoice choice)
      : video_(std::move(video)), choice_(choice) {}

  std::optional<CalibrationImage> next() {
    for (; !choice_.has(frames_); ++frames_) {
      if (!video_.skip()) return std::nullopt;
    }
    auto image = video_.next();
    if (!image) return std::nullopt;
    const int64_t number = frames_++;
    return CalibrationImage{number, frame_name(number), std::move(*image)};
  }
  int64_t frames() const { return frames_; }

 private:
  ctl::VideoFile video_;
  FrameChoice choice_;
  int64_t frames_ = 0;  ///< that were decoded
};

ImageSource video_source(const fs::path& file, ctl::VideoFile video, FrameChoice choice) {
  ImageSource source{file.string(), video.announced_frames() / choice.stride, {}};
  const auto frames = std::make_shared<VideoFrames>(std::move(video), choice);
  source.next = [frames] { return frames->next(); };
  source.frames = [frames] { return frames->frames(); };
  return source;
}

}  // namespace

std::vector<ImageSource> open_videos(const std::vector<fs::path>& files, const Sampling& sampling) {
  std::vector<ctl::VideoFile> videos;
  int64_t most = 0;
  for (const fs::path& file : files) {
    videos.emplace_back(file);
    most = std::max(most, videos.back().announced_frames());
  }
  const FrameChoice choice = choice_of(most, sampling);
  std::vector<ImageSource> sources;
  for (size_t i = 0; i < files.size(); ++i) {
    sources.push_back(video_source(files[i], std::move(videos[i]), choice));
  }
  return sources;
}

ImageSource open_images(const std::string& pattern) {
  std::vector<fs::path> files = matching_files(pattern);
  std::erase_if(files, [](const fs::path& file) { return !ctl::has_image_name(file); });
  if (files.empty()) {
    throw InputError(pattern + ": no image matches (quote the pattern: 'boards/*.png')");
  }
  ImageSource source{pattern, std::ssize(files), {}};
  source.next = [files, position = size_t{0}]() mutable -> std::optional<CalibrationImage> {
    if (position == files.size()) return std::nullopt;
    const fs::path& file = files[position];
    return CalibrationImage{static_cast<int64_t>(position++), file.filename().string(),
                            ctl::read_image(file)};
  };
  return source;
}

namespace {

/// The frames of one camera.
struct CameraLog {
  std::string path;
  std::shared_ptr<take::FrameLogReader> reader;
  std::vector<int64_t> pulses;  ///< ascending, each once
};

CameraLog open_log(const fs::path& path) {
  CameraLog log{path.string(), std::make_shared<take::FrameLogReader>(path), {}};
  for (const FrameLabel& label : log.reader->labels()) log.pulses.push_back(label.pulse);
  std::sort(log.pulses.begin(), log.pulses.end());
  log.pulses.erase(std::unique(log.pulses.begin(), log.pulses.end()), log.pulses.end());
  return log;
}

ImageSource log_source(CameraLog log, FrameChoice choice) {
  std::erase_if(log.pulses, [&](int64_t pulse) { return !choice.has(pulse); });
  ImageSource source{log.path, std::ssize(log.pulses), {}};
  source.next = [log = std::move(log.reader), pulses = std::move(log.pulses),
                 position = size_t{0}]() mutable -> std::optional<CalibrationImage> {
    while (position < pulses.size()) {
      const int64_t pulse = pulses[position++];
      if (auto frame = log->read(pulse)) {
        return CalibrationImage{pulse, "pulse " + std::to_string(pulse), std::move(frame->image)};
      }
    }
    return std::nullopt;
  };
  return source;
}

}  // namespace

std::vector<ImageSource> open_take(const fs::path& take, const std::vector<std::string>& cameras,
                                   const Sampling& sampling) {
  const take::TakePaths paths{take};
  std::vector<CameraLog> logs;
  int64_t most = 0;
  for (const std::string& camera : cameras) {
    logs.push_back(open_log(paths.frames(camera)));
    if (!logs.back().pulses.empty()) most = std::max(most, logs.back().pulses.back() + 1);
  }
  const FrameChoice choice = choice_of(most, sampling);
  std::vector<ImageSource> sources;
  for (CameraLog& log : logs) sources.push_back(log_source(std::move(log), choice));
  return sources;
}

namespace {

/// A low rate, because boards move slowly and similar images add little information.
constexpr double kMaxRateHz = 5;

/// From the local time, which operators read.
std::string new_take_name() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[40];
  std::strftime(text, sizeof text, "calibration-%Y%m%d-%H%M%S", &local);
  return text;
}

bool has_all_cameras(const take::TakePaths& paths, const Studio& studio) {
  return fs::exists(paths.info()) &&
         std::all_of(studio.cameras.begin(), studio.cameras.end(), [&](const StudioCamera& camera) {
           return fs::exists(paths.frames(camera.name));
         });
}

void record(const Studio& studio, const ctl::ShortTrain& train) {
  control::OperatorClient client(studio);
  StatusLine status;
  const auto show = [&] {
    const auto health = client.health(Monotonic::now());
    if (std::any_of(health.begin(), health.end(),
                    [](const auto& entry) { return ctl::is_in_take(entry.second); })) {
      status.show("recording " + train.take + ": " + ctl::recording_line(health));
    }
  };
  const ctl::TakeAccount account = ctl::merge_ledgers(run_train(client, studio, train, show));
  if (!account.ledger.complete()) note("v3dctl: " + account.ledger.verdict());
}

/// Copies the take from the nodes that recorded it.
fs::path collect(const Studio& studio, const std::string& name) {
  const fs::path here = fs::current_path();
  const auto collected = ctl::collect_takes(
      {.sources = ctl::sources_of(studio), .to = here, .takes = {name}, .rsh = {}});
  for (const ctl::CollectedTake& take : collected) {
    if (!take.problem.empty()) throw std::runtime_error(name + ": " + take.problem);
  }
  return here / name;
}

}  // namespace

fs::path record_live_take(const Studio& studio, double seconds) {
  ctl::ShortTrain train{.take = new_take_name()};
  train.rate_hz = std::min(kMaxRateHz, studio.trigger.rate_hz);
  train.pulses = std::max<int64_t>(1, std::llround(seconds * train.rate_hz));
  record(studio, train);
  const take::TakePaths recorded{(studio.storage.takes / train.take).lexically_normal()};
  const fs::path take =
      has_all_cameras(recorded, studio) ? recorded.folder : collect(studio, train.take);
  note("v3dctl: the images are kept in the take " + take.string() + "; use them again with --take");
  return take;
}

namespace {

using calib::BoardDetector;
using calib::BoardObservation;

constexpr size_t kBatch = 8;
constexpr size_t kMaxDiagnosed = 6;

std::vector<CalibrationImage> next_batch(ImageSource& source) {
  std::vector<CalibrationImage> batch;
  while (batch.size() < kBatch) {
    auto image = source.next();
    if (!image) break;
    batch.push_back(std::move(*image));
  }
  return batch;
}

void require_one_size(const std::string& camera, const CalibrationImage& image,
                      FoundBoards& found) {
  if (found.images == 0) found.size = image.pixels.size;
  if (image.pixels.size == found.size) return;
  throw InputError(camera + ": " + image.name + " is " + format_size(image.pixels.size) +
                   ", the images before it are " + format_size(found.size));
}

/// A few evenly spaced images without the board, for the diagnosis.
class ImagesWithoutBoard {
 public:
  void add(CalibrationImage image) {
    if (seen_++ % stride_ != 0) return;
    kept_.push_back(std::move(image));
    if (kept_.size() < 2 * kMaxDiagnosed) return;
    for (size_t i = 1; i < kMaxDiagnosed; ++i) kept_[i] = std::move(kept_[2 * i]);
    kept_.resize(kMaxDiagnosed);
    stride_ *= 2;
  }

  /// The diagnosis of most images, with the name of the first of them: a single image may show
  /// only a part of the board.
  std::optional<std::string> diagnose(const BoardDetector& detector) const {
    std::vector<Diagnosis> diagnoses;
    for (const CalibrationImage& image : kept_) {
      ctl::stop_if_interrupted();
      if (auto found = detector.diagnose(image.pixels.view())) {
        count(std::move(*found), image.name, diagnoses);
      }
    }
    const auto best = std::ranges::max_element(diagnoses, {}, [](const Diagnosis& diagnosis) {
      return std::pair(!diagnosis.found.may_be_part, diagnosis.images);
    });
    if (best == diagnoses.end()) return std::nullopt;
    return best->first_image + ": " + best->found.text;
  }

 private:
  struct Diagnosis {
    calib::BoardDiagnosis found;
    std::string first_image;
    int images = 0;
  };

  static void count(calib::BoardDiagnosis found, const std::string& image,
                    std::vector<Diagnosis>& diagnoses) {
    auto same = std::ranges::find_if(
        diagnoses, [&](const Diagnosis& other) { return other.found.text == found.text; });
    if (same == diagnoses.end()) {
      same = diagnoses.insert(same, Diagnosis{std::move(found), image});
    }
    ++same->images;
  }

  std::vector<CalibrationImage> kept_;
  size_t seen_ = 0;
  size_t stride_ = 1;
};

void add_view(CalibrationImage& image, BoardObservation observation, FoundBoards& found) {
  int max_count = 0;
  for (const auto& view : found.views) max_count = std::max(max_count, view.observation.count());
  if (observation.count() > max_count) found.example = std::move(image.pixels);
  found.views.push_back({image.name, std::move(observation)});
  found.numbers.push_back(image.number);
}

void require_boards(const std::string& camera, const ImageSource& source, const FoundBoards& found,
                    const calib::Board& board) {
  if (found.images == 0) throw InputError(camera + ": " + source.name + ": contains no image");
  if (!found.views.empty()) return;
  if (found.diagnosis) throw InputError(camera + ": " + *found.diagnosis);
  throw InputError(camera + ": too few boards: no " + board.text() + " in any of " +
                   ctl::count_of(found.images, "image") + " of " + source.name +
                   ": is it completely visible, flat, sharp and well lit?");
}

}  // namespace

FoundBoards find_boards(const std::string& camera, ImageSource source,
                        const BoardDetector& detector) {
  FoundBoards found;
  ImagesWithoutBoard without_board;
  Progress progress("boards of " + camera, source.announced);
  while (true) {
    std::vector<CalibrationImage> batch = next_batch(source);
    if (batch.empty()) break;
    std::vector<std::optional<BoardObservation>> observations(batch.size());
    tbb::parallel_for(size_t{0}, batch.size(),
                      [&](size_t i) { observations[i] = detector.find(batch[i].pixels.view()); });
    for (size_t i = 0; i < batch.size(); ++i) {
      require_one_size(camera, batch[i], found);
      ++found.images;
      progress.advance();
      if (observations[i]) {
        add_view(batch[i], std::move(*observations[i]), found);
      } else {
        without_board.add(std::move(batch[i]));
      }
    }
    ctl::stop_if_interrupted();
  }
  if (source.frames) found.frames = source.frames();
  if (found.views.empty()) found.diagnosis = without_board.diagnose(detector);
  require_boards(camera, source, found, detector.board());
  return found;
}

}  // namespace v3d::calibrate
