#include "v3dctl/edit/editor.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "recon/editing/clip.h"
#include "recon/editing/feet.h"

namespace v3d::ctl {
namespace {

constexpr size_t kMaxFrames = 20'000;
constexpr double kSameRate = 1e-3;  ///< relative difference of two pulse rates that count as equal
constexpr size_t kAround = 10;      ///< frames beside a transition with which it is compared

/// The end of a message. `take`: of the clip; empty: it is the edited one.
std::string but_has(const recon::Clip& clip, const std::string& take) {
  return ", but the action " + (take.empty() ? std::string() : "of " + take + " ") + "has " +
         format_count(std::ssize(clip.frames));
}

/// The frame of a splice after a range of `frames` was stretched; empty where the next one is gone.
std::optional<size_t> stretched_splice(size_t frame, recon::ClipRange range, double factor,
                                       size_t frames) {
  if (frame < range.first) return frame;
  const size_t count = range.last - range.first;
  const size_t wanted = recon::stretched_frames(count, factor);
  if (frame >= range.last) return frame - count + wanted;
  const size_t last = recon::stretched_frame(count, factor, frame - range.first);
  if (last + 1 == wanted && range.last == frames) return std::nullopt;
  return range.first + last;
}

}  // namespace

Editor::Editor(TakeClip& edited, ReadTake read)
    : edited_(edited), clip_(edited.clip), read_(std::move(read)) {}

void Editor::apply(const Edit& edit) {
  where_ = edit.where;
  std::visit([this](const auto& operation) { apply(operation); }, edit.operation);
  require_at_most_max_frames(clip_.frames.size());
}

void Editor::require_at_most_max_frames(size_t frames) const {
  if (frames <= kMaxFrames) return;
  throw InputError(where_ + ": the action would have " +
                   format_count(static_cast<int64_t>(frames)) + " frames; expected at most " +
                   format_count(kMaxFrames) + ": cut it first");
}

recon::ClipRange Editor::range(const OptionalRange& range, const recon::Clip& clip,
                               const std::string& key, const std::string& take) const {
  const size_t frames = clip.frames.size();
  if (!range) return {0, frames};
  if (range->end <= static_cast<int64_t>(frames)) {
    return {static_cast<size_t>(range->first), static_cast<size_t>(range->end)};
  }
  throw InputError(where_ + "." + key + ": frames " + std::to_string(range->first) + " to " +
                   std::to_string(range->end) + but_has(clip, take));
}

void Editor::renumber_splices(const std::function<std::optional<size_t>(size_t)>& new_frame) {
  std::vector<SpliceReport> kept;
  for (SpliceReport& report : splices_) {
    const auto frame = new_frame(static_cast<size_t>(report.frame));
    if (!frame) continue;
    report.frame = static_cast<int64_t>(*frame);
    kept.push_back(report);
  }
  splices_ = std::move(kept);
}

void Editor::apply(const CutEdit& edit) {
  const recon::ClipRange kept = range(edit.frames, clip_, "frames");
  recon::cut(clip_, kept);
  renumber_splices([&](size_t frame) {
    const bool is_kept = frame >= kept.first && frame + 1 < kept.last;
    return is_kept ? std::optional(frame - kept.first) : std::nullopt;
  });
}
void Editor::apply(const StretchEdit& edit) {
  const recon::ClipRange stretched = range(edit.frames, clip_, "frames");
  const size_t before = stretched.last - stretched.first;
  // Frames of surfaces are large: the check comes before they are made.
  require_at_most_max_frames(clip_.frames.size() - before +
                             recon::stretched_frames(before, edit.factor));
  const size_t frames = clip_.frames.size();
  recon::stretch(clip_, stretched, edit.factor);
  renumber_splices(
      [&](size_t frame) { return stretched_splice(frame, stretched, edit.factor, frames); });
}
void Editor::apply(const MirrorEdit& /*edit*/) { recon::mirror(clip_); }

void Editor::require_part_on(recon::Joint joint, recon::ClipRange range) const {
  recon::Joint moving = joint;
  while (moving != recon::kPelvis && !recon::moves_surface(clip_, moving, range)) {
    moving = recon::parent(moving, clip_.prop_hand);
  }
  if (moving == joint) return;
  throw InputError(fmt::format(
      "{}.joint: {} moves no part of the surface in these frames; expected a joint that "
      "does, as {}",
      where_, recon::name(joint), recon::name(moving)));
}

void Editor::apply(const BendEdit& edit) {
  const recon::ClipRange bent = range(edit.frames, clip_, "frames");
  require_part_on(edit.joint, bent);
  recon::bend(clip_, {.joint = edit.joint,
                      .range = bent,
                      .radians = edit.degrees * std::numbers::pi / 180,
                      .axis = edit.axis,
                      .ramp = static_cast<size_t>(edit.ramp)});
}

void Editor::apply(const HoldFeetEdit& edit) {
  recon::hold_all_feet(clip_, static_cast<size_t>(edit.fade), stop_if_interrupted);
}

void Editor::require_frames_behind(recon::ClipRange range, const recon::Clip& clip, size_t blend,
                                   const std::string& key, const std::string& take) const {
  if (range.first + blend < clip.frames.size()) return;
  throw InputError(where_ + "." + key + ": a blend of " + std::to_string(blend) +
                   " frames needs them behind frame " + std::to_string(range.first) +
                   but_has(clip, take));
}

// Surfaces of either action can have weights of the prop. Its position is unknown in the other one.
void Editor::share_prop(TakeClip& added, const recon::SpliceTransition& transition) {
  if (edited_.has_prop == added.has_prop) return;
  if (edited_.has_prop) {
    recon::carry_prop(added.clip, clip_.frames[transition.at].skeleton, clip_.prop_hand);
    return;
  }
  recon::carry_prop(clip_, added.clip.frames[transition.from].skeleton, added.clip.prop_hand);
  edited_.has_prop = true;
  edited_.lengths.bones().back() = added.lengths.bones().back();
}

void Editor::apply(const SpliceEdit& edit) {
  TakeClip added = read_(edit.take);
  if (std::abs(added.clip.rate_hz / clip_.rate_hz - 1) > kSameRate) {
    throw InputError(
        fmt::format("{}.take: {} has {:g} pulses a second, the action {:g}; expected the same",
                    where_, edit.take.string(), added.clip.rate_hz, clip_.rate_hz));
  }
  const auto blend = static_cast<size_t>(edit.blend);
  if (std::min(clip_.frames.size(), added.clip.frames.size()) <= blend + 1) {
    throw InputError(where_ + ": a blend of " + std::to_string(blend) +
                     " frames needs more frames in both actions; they have " +
                     std::to_string(clip_.frames.size()) + " and " +
                     std::to_string(added.clip.frames.size()));
  }
  const recon::ClipRange at = range(edit.at, clip_, "at");
  const recon::ClipRange from = range(edit.from, added.clip, "from", edit.take.string());
  require_frames_behind(at, clip_, blend, "at");
  require_frames_behind(from, added.clip, blend, "from", edit.take.string());
  SpliceReport report;
  report.transition =
      recon::best_transition(clip_, at, added.clip, from, blend, stop_if_interrupted);
  share_prop(added, report.transition);
  const size_t last = recon::splice(clip_, std::move(added.clip), report.transition);
  report.frame = static_cast<int64_t>(last);
  report.next = static_cast<int64_t>(report.transition.from + last - report.transition.at);
  report.relative_jump = recon::relative_jump(clip_, last, kAround);
  renumber_splices(
      [&](size_t frame) { return frame < last ? std::optional(frame) : std::nullopt; });
  splices_.push_back(report);
}

void Editor::apply(const SwapEdit& edit) {
  const TakeClip other = read_(edit.take);
  const auto frames = std::ssize(other.clip.frames);
  if (edit.frame >= frames) {
    throw InputError(where_ + ".frame: " + std::to_string(edit.frame) + ", but the action of " +
                     edit.take.string() + " has " + format_count(frames));
  }
  recon::swap_performer(clip_, other.clip, static_cast<size_t>(edit.frame));
  splices_.clear();  // all frames have one surface
  edited_.has_prop = other.has_prop;
  edited_.lengths = other.lengths;
}

}  // namespace v3d::ctl
