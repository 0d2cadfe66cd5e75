#include "daemon/recorded/segmented_log.h"

#include "base/error.h"
#include "daemon/recorded/take_background.h"

namespace v3d {

SegmentedLog::SegmentedLog(const TakePaths& paths, const std::string& camera)
    : paths_(paths), log_(paths.frames(camera)) {
  for (size_t place = 0; place < labels().size(); ++place) {
    place_of_.emplace(labels()[place].pulse, place);
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
  learn_before(place_of_.at(pulse));
  Mask mask = segment(*raw);
  return SegmentedFrame{*std::move(raw), std::move(mask)};
}

void SegmentedLog::learn_before(size_t place) {
  if (!segmenter_) return;
  if (place < passed_) {
    segmenter_->forget();
    passed_ = 0;
  }
  for (; passed_ < place; ++passed_) {
    const int64_t pulse = labels()[passed_].pulse;
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
                     " is of other images than the frames: learn it again");
  }
  return segmenter_->segment(raw.image.view());
}

}  // namespace v3d
