#include "v3dctl/motion/motion_file.h"

#include <algorithm>
#include <string>

#include "base/core/error.h"

namespace v3d::ctl {
namespace {

/// Removes the pulses at the end of a segment that were not encoded.
void shorten(recon::TrackedSegment& segment, const codec::MotionSegment& encoded) {
  const size_t pulses = encoded.pulses.size();
  if (pulses == segment.pulses.size()) return;
  segment.shares_last = false;
  segment.key = encoded.key;
  segment.pulses.resize(pulses);
  segment.positions.resize(pulses);
  segment.confidences.resize(pulses);
  segment.residuals.resize(pulses);
}

}  // namespace

MotionFile::MotionFile(const TrackRequest& request, const std::vector<int64_t>& pulses)
    : request_(request),
      pulses_(pulses),
      writer_({.step_m = request.step_m}, {.bytes = request.max_bytes}) {
  const std::vector<uint8_t> header = codec::MotionWriter::header();
  bytes_.append(header.begin(), header.end());
}

bool MotionFile::add(const MotionPart& part,
                     const std::function<recon::TrackedSegment()>& segment) {
  if (part.bytes.empty()) reject(part.pulses.front());
  std::vector<int64_t>& without = report_.without_images;
  without.insert(without.end(), part.without_images.begin(), part.without_images.end());
  if (writer_.add_encoded(part.pulses, part.bytes.size())) {
    append(part);
    return true;
  }
  recon::TrackedSegment shortened = segment();
  MotionContent content = content_of(shortened);
  const auto encoded = writer_.add_first_pulses(content.motion);
  if (!encoded && (!writer_.is_full() || report_.segments.empty())) reject(part.pulses.front());
  if (encoded) {
    shorten(shortened, content.motion);
    append(part_of(shortened, *encoded, {}));
  }
  leave_out_after_last(part.pulses);
  return false;
}

void MotionFile::reject(int64_t first_pulse) const {
  throw InputError(request_.input.string() + ": the surface from pulse " +
                   std::to_string(first_pulse) +
                   " exceeds the limits of motion.v3d (docs/motion-format.md)");
}

void MotionFile::append(const MotionPart& part) {
  bytes_ += part.bytes;
  last_pulse_ = part.pulses.back();
  report_.template_bytes += part.template_bytes;
  report_.position_bytes += part.position_bytes;
  report_.colour_bytes += part.colour_bytes;
  report_.confidence_bytes += part.confidence_bytes;
  report_.segments.push_back(part.report);
}

/// `pulses`: of the segment that does not fit.
void MotionFile::leave_out_after_last(const std::vector<int64_t>& pulses) {
  const auto left_out = std::ranges::upper_bound(pulses, last_pulse_);
  const int64_t first = left_out == pulses.end() ? pulses.back() : *left_out;
  report_.full_from = first;
  std::erase_if(report_.without_images, [&](int64_t pulse) { return pulse >= first; });
}

TrackReport MotionFile::finish(std::span<const recon::UntrackedPulses> untracked) {
  report_.pulses = std::ssize(pulses_);
  report_.bytes = std::ssize(bytes_);
  for (const recon::UntrackedPulses& gap : untracked) {
    const int64_t first = pulses_[gap.first];
    if (report_.full_from && first >= *report_.full_from) break;
    report_.untracked.push_back({first, pulses_[gap.last], gap.reason});
  }
  if (report_.full_from) {
    report_.untracked.push_back({*report_.full_from, pulses_.back(), "the file is full"});
  }
  return report_;
}

}  // namespace v3d::ctl
