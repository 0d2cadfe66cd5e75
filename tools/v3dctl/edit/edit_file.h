// The list of operations of an edited action (docs/editing.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "recon/skeleton/body_model.h"

namespace v3d::ctl {

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

}  // namespace v3d::ctl
