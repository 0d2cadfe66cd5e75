// Applies the operations of an edit to an action.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "recon/editing/splice.h"
#include "v3dctl/edit/edit_file.h"
#include "v3dctl/edit/take_clip.h"

namespace v3d::ctl {

struct SpliceReport {
  int64_t frame = 0;  ///< the last one that shows the surface of the earlier action
  recon::Transition transition;
  double relative_jump = 0;  ///< recon::relative_jump()
};

/// Changes an action. One thread.
class Editor {
 public:
  /// Reads the take of a splice or a swap, as read_clip() does.
  using ReadTake = std::function<TakeClip(const std::filesystem::path& take)>;

  /// `edited` is borrowed, and must have a frame.
  Editor(TakeClip& edited, ReadTake read);

  /// Throws InputError, which begins with Edit::where, for an operation that does not fit the
  /// action, and as ReadTake does.
  void apply(const Edit& edit);

  const std::vector<SpliceReport>& splices() const { return splices_; }

 private:
  recon::ClipRange range(const OptionalRange& range, const recon::Clip& clip) const;
  recon::ClipRange range(const OptionalRange& range) const { return this->range(range, clip_); }
  void require_at_most_max_frames(size_t frames) const;
  void require_frames_behind(recon::ClipRange range, const recon::Clip& clip, size_t blend) const;
  /// Throws InputError for a joint whose bend would move no vertex in the range.
  void require_part_on(recon::Joint joint, recon::ClipRange range) const;
  /// Gives both actions the prop that one of them has.
  void share_prop(TakeClip& added, const recon::Transition& transition);

  void apply(const CutEdit& edit);
  void apply(const StretchEdit& edit);
  void apply(const MirrorEdit& edit);
  void apply(const BendEdit& edit);
  void apply(const HoldFeetEdit& edit);
  void apply(const SpliceEdit& edit);
  void apply(const SwapEdit& edit);

  TakeClip& edited_;
  recon::Clip& clip_;
  const ReadTake read_;
  std::string where_;
  std::vector<SpliceReport> splices_;
};

}  // namespace v3d::ctl
