#include "daemon/recorded/segmented_log.h"

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {

std::optional<BackgroundModel> load_take_background(const TakePaths& paths,
                                                    const std::string& camera) {
  const auto folder = io::value_or_throw(io::entry_type_of(paths.background()));
  if (folder == std::filesystem::file_type::symlink) {
    throw InputError(paths.background().string() +
                     ": it is a symbolic link; expected a folder of the take");
  }
  if (!has_background(paths.background(), camera)) return std::nullopt;
  return load_background(paths.background(), camera);
}

SegmentedLog::SegmentedLog(const TakePaths& paths, const std::string& camera)
    : paths_(paths), log_(paths.frames(camera)) {
  for (size_t index = 0; index < labels().size(); ++index) {
    index_of_.emplace(labels()[index].pulse, index);
  }
  if (auto model = load_take_background(paths, camera)) {
    segmenter_.emplace(*std::move(model), SegmentOptions{});
  }
}

std::optional<ImageSize> SegmentedLog::frame_size() {
  if (labels().empty()) return std::nullopt;
  const std::optional<Frame> first = log_.read(labels().front().pulse);
  return first ? std::optional(first->sensor_size) : std::nullopt;
}

std::optional<SegmentedFrame> SegmentedLog::read(int64_t pulse) {
  std::optional<Frame> raw = log_.read(pulse);
  if (!raw) return std::nullopt;
  if (raw->mask) {
    Mask mask = *std::move(raw->mask);
    raw->mask.reset();
    return SegmentedFrame{*std::move(raw), std::move(mask)};
  }
  learn_before(index_of_.at(pulse));
  Mask mask = segment(*raw);
  return SegmentedFrame{*std::move(raw), std::move(mask)};
}

void SegmentedLog::learn_before(size_t index) {
  if (!segmenter_) return;
  if (index < learnt_) {
    segmenter_->forget();
    learnt_ = 0;
  }
  for (; learnt_ < index; ++learnt_) {
    const int64_t pulse = labels()[learnt_].pulse;
    if (segmenter_->learns_from(pulse)) learn(pulse);
  }
}

void SegmentedLog::learn(int64_t pulse) {
  const std::optional<Frame> raw = log_.read(pulse);
  if (!raw || raw->mask) return;
  segmenter_->learn(pulse, raw->image.view(), segment(*raw));
}

Mask SegmentedLog::segment(const Frame& raw) {
  if (!segmenter_) {
    throw InputError(
        paths_.frames(raw.camera).string() + ": frames without masks, and no background model in " +
        paths_.background().string() + ": import with --masks, --background or --background-black");
  }
  if (segmenter_->size() != raw.image.size || segmenter_->format() != raw.image.format) {
    throw InputError(paths_.background().string() + ": the background model of " + raw.camera +
                     " has another image size or format than the frames: learn it again");
  }
  return segmenter_->segment(raw.image.view());
}

}  // namespace v3d
