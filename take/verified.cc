#include "take/verified.h"

#include <sys/stat.h>

#include "base/error.h"
#include "base/file.h"
#include "base/io/file.h"
#include "base/toml_file.h"
#include "take/log_segments.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// As it is now; empty when it is not there.
std::optional<VerifiedFile> look_at(const fs::path& file) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0) return std::nullopt;
  return VerifiedFile{
      .name = file.filename(),
      .bytes = status.st_size,
      .changed_ns = status.st_mtim.tv_sec * 1'000'000'000LL + status.st_mtim.tv_nsec};
}

std::vector<VerifiedFile> recorded_files(const TakePaths& paths, const TakeInfo& info) {
  std::vector<fs::path> places = {paths.info(), paths.ledger(), paths.calib()};
  const auto add_log = [&](const fs::path& log) {
    const auto segments = existing_segments(log);
    if (segments) places.insert(places.end(), segments->begin(), segments->end());
  };
  add_log(paths.pulses());
  for (const std::string& camera : info.cameras) add_log(paths.frames(camera));
  std::vector<VerifiedFile> files;
  for (const fs::path& place : places) {
    if (auto file = look_at(place)) files.push_back(std::move(*file));
  }
  return files;
}

}  // namespace

io::Status save_verified(const TakePaths& paths, const Verification& verification) {
  std::string text = "verdict = " + toml_string(verification.ledger.verdict()) +
                     "\nwhole = " + (verification.whole() ? "true" : "false") +
                     "\nat_ns = " + std::to_string(to_ns(Realtime::now())) +
                     "  # since 1970, CLOCK_REALTIME\n";
  for (const VerifiedFile& file : recorded_files(paths, verification.info)) {
    text += "\n[[file]]\nname = " + toml_string(file.name) +
            "\nbytes = " + std::to_string(file.bytes) +
            "\nchanged_ns = " + std::to_string(file.changed_ns) + "\n";
  }
  return io::replace_file(paths.verified(), text);
}

std::optional<Verified> load_verified(const TakePaths& paths) {
  try {
    Verified verified = parse_verified(read_take_file(paths.verified()), paths.verified());
    if (verified.files != recorded_files(paths, load_take_info(paths))) return std::nullopt;
    return verified;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Verified parse_verified(std::string_view text, const fs::path& path) {
  const TomlTable table = TomlTable::parse(text, path);
  Verified verified;
  verified.verdict = table.text("verdict");
  verified.whole = table.boolean_or("whole", false);
  verified.at = from_ns<Realtime>(table.integer("at_ns"));
  for (const TomlTable& file : table.tables("file")) {
    verified.files.push_back({.name = file.text("name"),
                              .bytes = file.integer("bytes"),
                              .changed_ns = file.integer("changed_ns")});
    file.refuse_unknown();
  }
  table.refuse_unknown();
  return verified;
}

}  // namespace v3d
