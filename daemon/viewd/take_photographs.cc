#include "daemon/viewd/take_photographs.h"

#include <algorithm>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/image/demosaic.h"
#include "base/image/jpeg.h"
#include "take/take.h"

namespace v3d {
namespace {

constexpr int kQuality = 90;

/// The colour correction of the camera; identity if the calibration cannot be read.
ColourResponse response_of(const TakePaths& paths, const std::string& camera) {
  try {
    const Rig rig = load_take_calib(paths);
    const int index = find_camera(rig, camera);
    if (index >= 0) return rig[static_cast<size_t>(index)].colour;
  } catch (const InputError&) {
  }
  return {};
}

}  // namespace

std::optional<std::vector<uint8_t>> TakePhotographs::read(const std::string& take, int64_t pulse,
                                                          const std::string& camera) {
  const std::optional<Frame> raw = frame(take, pulse, camera);
  if (!raw || raw->image.size.pixels() == 0) return {};
  Image picture = to_rgb(raw->image.view());
  const ColourResponse& colour = logs_.front().colour;
  if (!colour.is_identity()) correct(picture, colour);
  return encode_jpeg(picture.view(), kQuality);
}

std::optional<Frame> TakePhotographs::frame(const std::string& take, int64_t pulse,
                                            const std::string& camera) {
  OpenLog* log = find(take, camera);
  if (log == nullptr) return {};
  if (auto found = log->reader.read(pulse)) return found;
  const auto current = stamp_of_log(log->path);
  if (!current || *current == log->stamp || Monotonic::now() - log->opened < kReindexPeriod)
    return {};
  return open(take, camera, *current)->reader.read(pulse);
}

TakePhotographs::OpenLog* TakePhotographs::find(const std::string& take,
                                                const std::string& camera) {
  const std::filesystem::path path = TakePaths{takes_ / take}.frames(camera);
  const auto stamp = stamp_of_log(path);
  const auto known = std::ranges::find(logs_, path, &OpenLog::path);
  const bool same = known != logs_.end() && stamp && known->stamp.inode == stamp->inode &&
                    known->stamp.size <= stamp->size;
  if (same) {
    logs_.splice(logs_.begin(), logs_, known);
    return &logs_.front();
  }
  if (known != logs_.end()) logs_.erase(known);
  return stamp ? open(take, camera, *stamp) : nullptr;
}

TakePhotographs::OpenLog* TakePhotographs::open(const std::string& take, const std::string& camera,
                                                const FileStamp& stamp) {
  const TakePaths paths{takes_ / take};
  const std::filesystem::path path = paths.frames(camera);
  logs_.remove_if([&](const OpenLog& log) { return log.path == path; });
  logs_.push_front(
      {path, stamp, Monotonic::now(), FrameLogReader(path), response_of(paths, camera)});
  if (logs_.size() > kMaxLogs) logs_.pop_back();
  return &logs_.front();
}

}  // namespace v3d
