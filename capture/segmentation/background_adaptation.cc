#include "capture/segmentation/background.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "capture/segmentation/background_adaptation.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>

#include "base/core/error.h"

#ifndef V3D_CAPTURE_BACKGROUND_STEP
#define V3D_CAPTURE_BACKGROUND_STEP
namespace v3d::segmentation {
namespace {

/// Consecutive samples of a row. The scales are those of BackgroundTable.
struct SampleRun {
  const uint8_t* seen;
  const uint16_t* plates;
  const uint8_t* sharpness;
  uint16_t* mean;
  size_t samples;
};

struct StepParameters {
  uint16_t gain;
  int sharpness_shift;
  uint16_t max_distance;  ///< maximum distance of a sample that is learnt, in the table's steps
};

}  // namespace
}  // namespace v3d::segmentation
#endif

HWY_BEFORE_NAMESPACE();
namespace v3d::segmentation::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kStepShift = 3;  ///< 1/16: from a difference in 1/128 to a step in 1/256 grey value
constexpr uint16_t kMaxStep = 64;  ///< 1/256 grey value
constexpr uint16_t kMaxDrift = 8 * 256;
constexpr uint16_t kWhite = 255 * 256;

void step(const SampleRun& at, const StepParameters& parameters) {
  const hn::CappedTag<uint16_t, 32> shorts;
  const hn::Rebind<uint8_t, decltype(shorts)> bytes;
  const auto max_step = hn::Set(shorts, kMaxStep);
  for (size_t i = 0; i < at.samples; i += hn::Lanes(shorts)) {
    // Vectors extend beyond the last sample; only the samples within are written.
    const auto within = hn::FirstN(shorts, at.samples - i);
    const auto mean = hn::LoadU(shorts, at.mean + i);
    const auto plate = hn::LoadU(shorts, at.plates + i);
    const auto sharp = hn::ShiftLeftSame(hn::PromoteTo(shorts, hn::LoadU(bytes, at.sharpness + i)),
                                         parameters.sharpness_shift);
    const auto seen = hn::ShiftLeft<7>(hn::PromoteTo(shorts, hn::LoadU(bytes, at.seen + i)));
    const auto expected =
        hn::Min(hn::MulHigh(mean, hn::Set(shorts, parameters.gain)), hn::Set(shorts, kMaxExpected));
    const auto above = hn::SaturatedSub(seen, expected);
    const auto below = hn::SaturatedSub(expected, seen);
    const auto distance = hn::MulHigh(hn::Or(above, below), sharp);
    const auto is_far = hn::Gt(distance, hn::Set(shorts, parameters.max_distance));
    const auto raised = hn::Add(mean, hn::Min(hn::ShiftRight<kStepShift>(above), max_step));
    const auto moved =
        hn::SaturatedSub(raised, hn::Min(hn::ShiftRight<kStepShift>(below), max_step));
    const auto drift = hn::Add(hn::ShiftRight<2>(plate), hn::Set(shorts, kMaxDrift));
    const auto highest = hn::Min(hn::SaturatedAdd(plate, drift), hn::Set(shorts, kWhite));
    const auto limited = hn::Min(hn::Max(moved, hn::SaturatedSub(plate, drift)), highest);
    hn::BlendedStore(limited, hn::AndNot(is_far, within), shorts, at.mean + i);
  }
}

}  // namespace
}  // namespace v3d::segmentation::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::segmentation {
namespace {

HWY_EXPORT(step);

constexpr int kCellWidth = 32;  ///< pixels
constexpr int kCellHeight = 16;
constexpr float kMaxDistance = 3;  ///< spreads

int columns_of(ImageSize size) { return (size.width + kCellWidth - 1) / kCellWidth; }
int rows_of(ImageSize size) { return (size.height + kCellHeight - 1) / kCellHeight; }

}  // namespace

void BackgroundAdaptation::mark_busy_cells(const Mask& mask) {
  const int columns = columns_of(mask.size());
  const int rows = rows_of(mask.size());
  occupied_.assign(static_cast<size_t>(columns) * rows, 0);
  for (int y = 0; y < mask.size().height; ++y) {
    uint8_t* cells = &occupied_[static_cast<size_t>(y / kCellHeight) * columns];
    const auto words = mask.row(y);
    for (int i = 0; i < columns; ++i) {
      cells[i] |= static_cast<uint32_t>(words[i / 2] >> (i % 2 * kCellWidth)) != 0;
    }
  }
  busy_.assign(occupied_.size(), 0);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (occupied_[static_cast<size_t>(row) * columns + column] == 0) continue;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, rows - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, columns - 1); ++c) {
          busy_[static_cast<size_t>(r) * columns + c] = 1;
        }
      }
    }
  }
}

void BackgroundAdaptation::adapt(ImageView image, const Mask& mask, uint32_t gain,
                                 BackgroundTable& table) {
  V3D_CHECK(image.size == table.size && image.format == table.format && mask.size() == table.size);
  mark_busy_cells(mask);
  const StepParameters parameters{static_cast<uint16_t>(gain), table.sharpness_shift,
                                  static_cast<uint16_t>(kMaxDistance * table.steps_per_spread)};
  const int columns = columns_of(table.size);
  const size_t row_samples = static_cast<size_t>(table.size.width) * table.channels;
  const size_t cell_samples = static_cast<size_t>(kCellWidth) * table.channels;
  // Vector loads must not read beyond the image, so its last samples are copied to tail_.
  tail_.resize(cell_samples + BackgroundTable::kReach);
  for (int y = 0; y < table.size.height; ++y) {
    const uint8_t* busy = &busy_[static_cast<size_t>(y / kCellHeight) * columns];
    for (int i = 0; i < columns; ++i) {
      if (busy[i] != 0) continue;
      const size_t first = i * cell_samples;
      const size_t at = y * row_samples + first;
      const size_t samples = std::min(cell_samples, row_samples - first);
      const uint8_t* seen = image.bytes.data() + at;
      if (at + cell_samples > image.bytes.size()) {
        std::copy_n(seen, samples, tail_.begin());
        seen = tail_.data();
      }
      HWY_DYNAMIC_DISPATCH(step)
      ({seen, &plates_[at], &table.sharpness[at], &table.mean[at], samples}, parameters);
    }
  }
}

}  // namespace v3d::segmentation
#endif
