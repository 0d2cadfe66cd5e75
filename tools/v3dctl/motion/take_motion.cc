#include "v3dctl/motion/take_motion.h"

#include <fmt/core.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "codec/motion_pulse.h"
#include "common/console.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/render/renderer.h"
#include "v3dctl/motion/pulse_source.h"

namespace v3d::ctl {
namespace {

template <class Value>
double median_of(const std::vector<recon::PulseResidual>& residuals,
                 Value recon::PulseResidual::*value) {
  std::vector<double> values;
  for (const recon::PulseResidual& residual : residuals) {
    values.push_back(static_cast<double>(residual.*value));
  }
  return median(values);
}

TrackedSegmentReport report_of(const recon::TrackedSegment& segment) {
  constexpr double kMillimetres = 1000;
  TrackedSegmentReport report;
  report.first = segment.pulses.front();
  report.pulses = std::ssize(segment.pulses) - (segment.shares_last ? 1 : 0);
  report.last = segment.pulses[static_cast<size_t>(report.pulses) - 1];
  report.key = segment.pulses[segment.key];
  report.vertices = std::ssize(segment.surface.vertices);
  report.triangles = std::ssize(segment.surface.triangles);
  report.residual_p50_mm =
      kMillimetres * median_of(segment.residuals, &recon::PulseResidual::median_m);
  report.residual_p90_mm =
      kMillimetres * median_of(segment.residuals, &recon::PulseResidual::p90_m);
  for (size_t i = 0; i < static_cast<size_t>(report.pulses); ++i) {
    const recon::PulseResidual& residual = segment.residuals[i];
    report.far = std::max({report.far, residual.far, residual.surplus});
    report.residuals.emplace_back(segment.pulses[i], residual);
  }
  report.patch_correlation = median_of(segment.residuals, &recon::PulseResidual::correlation);
  report.matched_patches =
      static_cast<int64_t>(median_of(segment.residuals, &recon::PulseResidual::matched_patches));
  return report;
}

using ColourRow = std::vector<codec::VertexColour>;  ///< of the vertices at a pulse

/// Replaces empty rows by the nearest row with colours, the earlier one of two. Requires one.
void fill_from_nearest(std::vector<ColourRow>& rows) {
  std::vector<size_t> known;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].empty()) known.push_back(i);
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].empty()) continue;
    const auto distance = [i](size_t k) { return k > i ? k - i : i - k; };
    rows[i] = rows[*std::ranges::min_element(known, {}, distance)];
  }
}

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

static_assert(codec::MotionLimits::kFileBytes <= io::kMaxTextBytes, "programs read the whole file");

/// Tracks and encodes in the caller's TBB arena.
class MotionMaker {
 public:
  MotionMaker(ObservedPulses& input, const TrackRequest& request,
              const std::function<void()>& on_pulse)
      : input_(input),
        request_(request),
        on_pulse_(on_pulse),
        writer_({.step_m = request.step_m}, {.bytes = request.max_bytes}) {}

  TrackReport run() {
    recon::TrackedMotion motion = recon::track_motion(
        {[this](size_t i) { return input_.read(i); },
         [this](size_t i) { return input_.read_surface(i); },
         [this](size_t i, const Mesh& surface) { return input_.colours(i, surface); }},
        input_.pulses().size(), request_.tracking, [this](size_t) {
          stop_if_interrupted();
          on_pulse_();
        });
    if (motion.segments.empty()) {
      throw InputError(request_.input.string() +
                       ": no pulse has a surface to track; expected other frames, or meshes of the "
                       "space in which the performer is");
    }
    report_.pulses = std::ssize(input_.pulses());
    append(codec::MotionWriter::header());
    for (recon::TrackedSegment& segment : motion.segments) {
      if (!add(segment)) break;
    }
    report_untracked(motion.untracked);
    report_.is_unfinished = input_.is_unfinished();
    report_.read_errors = input_.read_errors();
    report_.bytes = std::ssize(bytes_);
    return report_;
  }

  const std::string& bytes() const { return bytes_; }

 private:
  /// False when the file has no room for all pulses of the segment. Then it has the first of them.
  bool add(recon::TrackedSegment& segment) {
    codec::MotionSegment content = recon::motion_segment(segment);
    content.colours = colours_of(segment);
    const std::vector<int64_t> pulses = segment.pulses;
    const auto encoded = writer_.add_first_pulses(content);
    if (!encoded && (!writer_.is_full() || report_.segments.empty())) {
      throw InputError(request_.input.string() + ": the surface from pulse " +
                       std::to_string(segment.pulses.front()) +
                       " exceeds the limits of motion.v3d (docs/motion-format.md)");
    }
    if (encoded) {
      shorten(segment, content);
      append(segment, *encoded);
    }
    if (writer_.is_full()) leave_out_after_last(pulses);
    return !writer_.is_full();
  }

  void append(const recon::TrackedSegment& segment, const codec::EncodedMotion& encoded) {
    append(encoded.bytes);
    last_pulse_ = segment.pulses.back();
    const codec::MotionBytes& parts = encoded.parts;
    report_.template_bytes += static_cast<int64_t>(
        parts.header + parts.triangles + parts.template_positions + parts.template_colours);
    report_.position_bytes += static_cast<int64_t>(parts.positions);
    report_.colour_bytes += static_cast<int64_t>(parts.colours);
    report_.confidence_bytes += static_cast<int64_t>(parts.confidences);
    report_.segments.push_back(report_of(segment));
  }

  /// `pulses`: of the segment that does not fit.
  void leave_out_after_last(const std::vector<int64_t>& pulses) {
    const auto left_out = std::ranges::upper_bound(pulses, last_pulse_);
    const int64_t first = left_out == pulses.end() ? pulses.back() : *left_out;
    report_.full_from = first;
    std::erase_if(report_.without_images, [&](int64_t pulse) { return pulse >= first; });
  }

  void report_untracked(const std::vector<recon::UntrackedPulses>& gaps) {
    for (const recon::UntrackedPulses& gap : gaps) {
      const int64_t first = input_.pulses()[gap.first];
      if (report_.full_from && first >= *report_.full_from) break;
      report_.untracked.push_back({first, input_.pulses()[gap.last], gap.reason});
    }
    if (!report_.full_from) return;
    report_.untracked.push_back({*report_.full_from, input_.pulses().back(), "the file is full"});
  }

  /// A pulse without images has the colours of the nearest pulse with images; without any, all have
  /// those of the template.
  std::vector<ColourRow> colours_of(const recon::TrackedSegment& segment) {
    std::vector<ColourRow> rows;
    std::vector<int64_t> without;
    for (size_t i = 0; i < segment.pulses.size(); ++i) {
      rows.push_back(recon::vertex_colours(segment.colours[i]));
      const bool is_in_next = segment.shares_last && i + 1 == segment.pulses.size();
      if (rows.back().empty() && !is_in_next) without.push_back(segment.pulses[i]);
    }
    if (std::ranges::any_of(rows, [](const ColourRow& row) { return !row.empty(); })) {
      fill_from_nearest(rows);
      report_.without_images.insert(report_.without_images.end(), without.begin(), without.end());
      return rows;
    }
    if (segment.surface.colours.empty()) return {};
    return {recon::vertex_colours(segment.surface.colours)};
  }

  void append(const std::vector<uint8_t>& bytes) { bytes_.append(bytes.begin(), bytes.end()); }

  ObservedPulses& input_;
  const TrackRequest& request_;
  const std::function<void()>& on_pulse_;
  codec::MotionWriter writer_;
  int64_t last_pulse_ = -1;  ///< in the file
  TrackReport report_;
  std::string bytes_;
};

/// Throws InputError where the steps of motion.v3d do not reach from the middle of the surface to
/// its ends: before the tracking, which takes seconds a pulse.
void require_steps(const TrackRequest& request, const Mesh& surface) {
  const double reach = codec::kMaxLattice * request.step_m;
  if (surface.vertices.empty()) return;
  const double half = 0.5 * recon::bounds_of(surface).size().maxCoeff();
  if (half <= reach) return;
  throw InputError(fmt::format(
      "{}: its first surface has an extent of {:.4g} m, but steps of {:.4g} m reach "
      "{:.4g} m; expected a larger --step{}",
      request.input.string(), 2 * half, request.step_m, 2 * reach,
      request.meshes_only ? ", or --height for meshes in other units than metres" : ""));
}

}  // namespace

TrackReport track_take(const TrackRequest& request,
                       const std::function<void(int64_t pulses)>& on_begin,
                       const std::function<void()>& on_pulse) {
  const MonotonicInstant began = Monotonic::now();
  const std::unique_ptr<ObservedPulses> input =
      request.meshes_only ? open_mesh_folder(request.input, request.height_m, request.frames)
                          : open_take_pulses(request.input, request.frames);
  on_begin(std::ssize(input->pulses()));
  const int threads = request.threads > 0 ? request.threads : tbb::info::default_concurrency();
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism,
                                    static_cast<size_t>(threads));
  tbb::task_arena arena(threads);
  MotionMaker maker(*input, request, on_pulse);
  TrackReport report = arena.execute([&] {
    require_steps(request, input->read_surface(0)->surface);
    return maker.run();
  });
  if (request.out.empty()) {
    io::throw_if_failed(io::replace_file(take::TakePaths{request.input}.motion(), maker.bytes()));
  } else {
    replace_file(request.out, maker.bytes());
  }
  report.peak_rss_mb = peak_rss_mb();
  report.seconds = to_seconds(Monotonic::now() - began);
  return report;
}

}  // namespace v3d::ctl
