#include "base/io/recorded_file.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "base/core/error.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// TakePaths (take/take.h) has these names, too; tests/take/removal_test.cc compares them.
constexpr std::array<std::string_view, 10> kTakeFiles{
    "take.toml", "ledger.toml", "calib.toml", "studio.toml", "mesh.v3d",
    "proxy.v3d", "motion.v3d",  "edit.json",  "slate.toml",  "verified.toml"};

bool is_log(std::string_view name) {
  return name.ends_with(".lcmlog") || name.ends_with(".lcmlog.index");
}

bool is_take_file(std::string_view name) {
  return std::ranges::find(kTakeFiles, name) != kTakeFiles.end() || name.starts_with(".") ||
         (name.starts_with("signature.") && name.ends_with(".toml")) ||
         (name.starts_with("repaired.") && name.ends_with(".txt")) ||
         (name.starts_with("motion.earlier-") && name.ends_with(".v3d"));
}

bool is_take(const fs::path& folder) {
  std::error_code absent;
  return fs::exists(fs::symlink_status(folder / "take.toml", absent));
}

}  // namespace

bool is_recorded_file(const fs::path& path) {
  const std::string name = path.filename();
  if (is_log(name)) return true;
  std::error_code absent;
  if (!fs::exists(fs::symlink_status(path, absent))) return false;
  const fs::path folder = fs::canonical(path.has_parent_path() ? path.parent_path() : ".", absent);
  if (is_take(folder)) return is_take_file(name);
  const bool is_inside = folder.filename() == "background" || folder.filename() == "sound";
  return is_inside && is_take(folder.parent_path());
}

void require_unrecorded(const fs::path& path) {
  if (!is_recorded_file(path)) return;
  throw InputError(path.string() + ": is a recorded file of a take; expected another file name");
}

}  // namespace v3d
