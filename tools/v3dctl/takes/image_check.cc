#include "v3dctl/takes/image_check.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <deque>

#include "base/core/error.h"
#include "base/geometry/box.h"
#include "base/image/mask_morphology.h"
#include "common/console.h"
#include "daemon/recorded/take_frames.h"
#include "recon/hull/bounds_mask.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"
#include "v3dctl/reconstruct/reconstruction_bounds.h"

namespace v3d::ctl {
namespace {

/// Voxels along the longest edge of the bounds: about the resolution of an XGA camera.
constexpr double kVoxels = 256;

/// Masks of all cameras at one pulse, limited to the view of the bounds.
struct Silhouettes {
  int64_t pulse = 0;
  std::vector<std::optional<Mask>> masks;
};

class ImageCheck {
 public:
  explicit ImageCheck(const ImageCheckRequest& request)
      : take_(request.take, {}),
        bounds_(bounds_of(request)),
        hulls_(take_.rig(), bounds_, longest_edge() / kVoxels,
               default_min_views(static_cast<int>(take_.rig().size()))),
        frame_lags_(take_.rig()),
        displacements_(take_.rig()),
        views_(take_.rig().size()),
        pulses_(evenly_spread(take_.pulses(), request)),
        progress_("check images", std::ssize(pulses_)) {
    tbb::parallel_for(size_t{0}, views_.size(),
                      [&](size_t i) { views_[i] = bounds_mask(bounds_, take_.rig()[i].model); });
  }

  ImageCheckResult run() {
    for (const int64_t pulse : pulses_) {
      stop_if_interrupted();
      move_window_to(pulse);
      add(windows());
      progress_.advance();
    }
    return {frame_lags_.result(), displacements_.result(hulls_)};
  }

 private:
  void add(const std::vector<MaskWindow>& windows) {
    std::vector<const Mask*> masks;
    for (const MaskWindow& window : windows) masks.push_back(window[kMaxPulsesOff]);
    const std::vector<Mask> expected = hulls_.silhouettes_of_each(masks);
    frame_lags_.add(windows, expected);
    displacements_.add(masks, expected);
  }

  Box bounds_of(const ImageCheckRequest& request) const {
    if (request.studio && request.studio->name == take_.info().studio) {
      return request.studio->space.bounds;
    }
    return default_bounds(take_.rig(), default_min_views(static_cast<int>(take_.rig().size())));
  }
  double longest_edge() const { return (bounds_.max - bounds_.min).maxCoeff(); }

  /// Pulses to compare; each has kMaxPulsesOff neighbours on both sides.
  static std::vector<int64_t> evenly_spread(const std::vector<int64_t>& all,
                                            const ImageCheckRequest& request) {
    const int64_t usable = std::ssize(all) - 2 * kMaxPulsesOff;
    if (usable < 1) {
      throw InputError(request.take.string() +
                       ": has too few pulses to compare cameras; expected at least " +
                       std::to_string(kShifts));
    }
    const int64_t wanted = std::min<int64_t>(request.pulses, usable);
    std::vector<int64_t> pulses;
    for (int64_t i = 0; i < wanted; ++i) {
      pulses.push_back(all[static_cast<size_t>(kMaxPulsesOff + i * usable / wanted)]);
    }
    return pulses;
  }

  /// Reads only pulses after the last one of the window: sequential reading is cheap.
  void move_window_to(int64_t pulse) {
    while (!window_.empty() && window_.front().pulse < pulse - kMaxPulsesOff) window_.pop_front();
    int64_t next = window_.empty() ? pulse - kMaxPulsesOff : window_.back().pulse + 1;
    for (; next <= pulse + kMaxPulsesOff; ++next) window_.push_back(read(next));
  }

  Silhouettes read(int64_t pulse) {
    Silhouettes result{.pulse = pulse, .masks = {}};
    const auto frames = take_.read(pulse);
    for (size_t i = 0; i < frames.size(); ++i) {
      const bool usable = frames[i] && frames[i]->mask.size() == views_[i].size();
      result.masks.push_back(usable ? std::optional(intersection_of(frames[i]->mask, views_[i]))
                                    : std::nullopt);
    }
    return result;
  }

  std::vector<MaskWindow> windows() const {
    std::vector<MaskWindow> windows(views_.size());
    for (size_t shift = 0; shift < kShifts; ++shift) {
      for (size_t camera = 0; camera < views_.size(); ++camera) {
        const std::optional<Mask>& mask = window_[shift].masks[camera];
        windows[camera][shift] = mask ? &*mask : nullptr;
      }
    }
    return windows;
  }

  TakeFrames take_;
  const Box bounds_;
  LeaveOneOutHull hulls_;
  SyncCheck frame_lags_;
  DisplacementMeter displacements_;
  std::vector<Mask> views_;
  const std::vector<int64_t> pulses_;
  std::deque<Silhouettes> window_;
  Progress progress_;
};

std::string frame_lag_text(const CameraSync& camera) {
  const int late = camera.pulses_late();
  const int best = kMaxPulsesOff + late;
  char text[200];
  std::snprintf(text, sizeof text,
                "frame lag, %s %s: its silhouettes differ from the hull of the other cameras by "
                "%.1f %% of their pixels, and by %.1f %% with the lag corrected",
                count_of(std::abs(late), "pulse").c_str(), late > 0 ? "late" : "early",
                100 * camera.disagreement[kMaxPulsesOff],
                100 * camera.disagreement[static_cast<size_t>(best)]);
  return camera.camera + ": " + text;
}

}  // namespace

ImageCheckResult check_images(const ImageCheckRequest& request) {
  return ImageCheck(request).run();
}

std::vector<std::string> fault_lines(const ImageCheckResult& result) {
  std::vector<std::string> lines;
  for (const CameraSync& camera : result.frame_lags) {
    if (camera.pulses_late() != 0) lines.push_back(frame_lag_text(camera));
  }
  // A frame lag shifts silhouettes, too.
  if (!lines.empty()) return lines;
  for (const CameraDisplacement& camera : result.displacements) {
    if (!camera.displaced) continue;
    lines.push_back(camera.camera + ": " + text_of(camera) + "; calibrate it again");
  }
  return lines;
}

}  // namespace v3d::ctl
