// Editing of actions (docs/editing.md): actions of takes, the list of operations, and their
// application.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "recon/editing/clip.h"
#include "recon/editing/splice.h"
#include "recon/skeleton/body_model.h"

namespace v3d::ctl {

struct TakeSkeleton;

// --- actions of takes, read for editing and written as takes: take_clip.cc

struct TakeClip {
  recon::Clip clip;
  bool has_prop = false;
  recon::BodyLengths lengths{0, 0};  ///< learnt; of the first of spliced takes
  /// Pulses from the first to the last mesh of the take that are in no tracked segment with a skin.
  int64_t left_out = 0;
  std::vector<std::string> problems;  ///< of TakeSkeleton
  bool has_good_pulse = false;        ///< some pulse shows head, feet, and hands or a prop
  bool is_unfinished = false;         ///< mesh.v3d has no index: pulses may be missing
};

/// The frames of all tracked surfaces with a skin: one for each pulse from the first to the last of
/// a segment, with the skeleton of that segment. A pulse that two segments share has the surface of
/// the later one. Lost pulses inside a segment are interpolated.
recon::Clip clip_of(TakeSkeleton skeleton);

/// Reads the tracked surface of a take, and learns its skeleton and skin (learn_skeleton()). The
/// clip is that of clip_of(), so the action keeps its speed. Calls `on_begin` with the number of
/// pulses and `on_pulse` after each. Throws InputError for a take without a tracked surface, and
/// for pulses of a segment that are more than recon::kMaxPulseStep apart; std::runtime_error after
/// an interrupt.
TakeClip read_clip(const std::filesystem::path& take, const std::function<void(int64_t)>& on_begin,
                   const std::function<void()>& on_pulse);

/// Throws InputError for a folder whose name cannot name a take, or that holds something else than
/// an edited take.
void check_output(const std::filesystem::path& out);

/// Writes a take of its own: take.toml, calib.toml of `source`, motion.v3d, skeleton.json and
/// edit.json with the text `edits`. Pulses are numbered from 0. An earlier edit in `out` stays
/// until the new one is complete. Throws InputError as check_output(), and for a clip that exceeds
/// the limits of motion.v3d; std::runtime_error for errors of the disk.
void write_clip(const TakeClip& edited, const std::filesystem::path& source,
                const std::string& edits, const std::filesystem::path& out);

// --- the list of operations of an edited action: edit_file.cc

/// Frames first to end - 1 of the action as it is when an operation begins.
struct EditRange {
  int64_t first = 0, end = 0;
};
/// A range, or all frames.
using OptionalRange = std::optional<EditRange>;

struct CutEdit {
  EditRange frames;
};
struct StretchEdit {
  OptionalRange frames;
  double factor = 1;
};
struct MirrorEdit {};
struct BendEdit {
  OptionalRange frames;
  recon::Joint joint = recon::kLeftElbow;
  double degrees = 0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();  ///< unit vector, in the frame of the joint
  int64_t ramp = 0;                                 ///< frames
};
struct SpliceEdit {
  std::filesystem::path take;
  OptionalRange at;    ///< of the action: where it may be left; otherwise anywhere
  OptionalRange from;  ///< of the take: where it may be entered
  int64_t blend = 10;  ///< frames
};
struct HoldFeetEdit {
  int64_t fade = 5;  ///< frames
};
struct SwapEdit {
  std::filesystem::path take;
  int64_t frame = 0;  ///< of the take, whose surface is shown
};

struct Edit {
  std::string where;  ///< "edit.json: operations[2]", for errors
  std::variant<CutEdit, StretchEdit, MirrorEdit, BendEdit, SpliceEdit, HoldFeetEdit, SwapEdit>
      operation;
};

/// The other take that an operation reads; null where it reads none.
const std::filesystem::path* take_of(const Edit& edit);

/// Throws InputError, with file, field and what would be right. Paths of takes are relative to the
/// folder of the file.
std::vector<Edit> parse_edits(std::string_view text, const std::filesystem::path& file);
std::vector<Edit> load_edits(const std::filesystem::path& file);

/// `text` of an edit file for a copy in `folder`: the paths of takes are relative to that. The
/// other fields stay, and without another take the whole text. Throws InputError as parse_edits().
std::string edits_for_folder(const std::string& text, const std::filesystem::path& file,
                             const std::filesystem::path& folder);

// --- application of the operations: editor.cc

struct SpliceReport {
  /// The last frame that shows the surface of the earlier action, in the action as it is after all
  /// operations. After it comes the frame `next` of the other take.
  int64_t frame = 0, next = 0;
  recon::SpliceTransition transition;  ///< in the action as it was before the splice
  double relative_jump = 0;            ///< recon::relative_jump()
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

  /// Without those of which later operations removed one of the frames where the surface changes.
  const std::vector<SpliceReport>& splices() const { return splices_; }

 private:
  /// The frames of `clip` that the field `key` of the operation states. `take`: the action of which
  /// take the clip is; empty: the edited one. Throws InputError for a range beyond its end.
  recon::ClipRange range(const OptionalRange& range, const recon::Clip& clip,
                         const std::string& key, const std::string& take = {}) const;
  void require_at_most_max_frames(size_t frames) const;
  /// `key` and `take` as for range().
  void require_frames_behind(recon::ClipRange range, const recon::Clip& clip, size_t blend,
                             const std::string& key, const std::string& take = {}) const;
  /// Throws InputError for a joint whose bend would move no vertex in the range.
  void require_part_on(recon::Joint joint, recon::ClipRange range) const;
  /// Gives both actions the prop that one of them has.
  void share_prop(TakeClip& added, const recon::SpliceTransition& transition);

  /// Gives each splice its new frame. Removes those for which `new_frame` returns none.
  void renumber_splices(const std::function<std::optional<size_t>(size_t frame)>& new_frame);

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
