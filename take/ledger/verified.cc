#include "take/ledger/verified.h"

#include <algorithm>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/whole_file.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

bool is_compared(const std::string& name) {
  const TakePaths paths;
  return name != paths.slate() && name != paths.verified();
}

/// True when every file still has its recorded length and modification time.
bool is_unchanged(const TakePaths& paths, const std::vector<TakeFile>& files) {
  const auto names = take_file_names(paths);
  if (!names) return false;
  size_t known = 0;
  for (const TakeFile& file : files) {
    if (!is_compared(file.name)) continue;
    ++known;
    const auto now = stat_take_file(paths, file.name);
    if (!now || now->bytes != file.bytes || now->changed_ns != file.changed_ns) return false;
  }
  return known == static_cast<size_t>(std::ranges::count_if(*names, is_compared));
}

/// Fails for an entry without a checksum: a record of an older version is not valid.
TakeFile read_entry(const TomlTable& table) {
  TakeFile file{.name = table.text("name"),
                .bytes = table.integer("bytes"),
                .changed_ns = table.integer("changed_ns"),
                .checksum = parse_checksum(table.text("xxh3"))};
  if (!file.checksum) table.fail("xxh3", "expected 16 hexadecimal digits");
  table.reject_unknown_fields();
  return file;
}

}  // namespace

io::Status save_verified(const TakePaths& paths, const Verification& verification) {
  std::string text = "verdict = " + toml_string(verification.ledger.verdict()) +
                     "\nwhole = " + (verification.whole() ? "true" : "false") +
                     "\nagrees = " + (verification.disagreements.empty() ? "true" : "false") +
                     "\nat_ns = " + std::to_string(to_ns(Realtime::now())) +
                     "  # since 1970, CLOCK_REALTIME\n";
  for (const TakeFile& file : verification.files) {
    text += "\n[[file]]\nname = " + toml_string(file.name) +
            "\nbytes = " + std::to_string(file.bytes) +
            "\nchanged_ns = " + std::to_string(file.changed_ns) +
            "\nxxh3 = " + toml_string(checksum_text(file.checksum.value())) + "\n";
  }
  return io::replace_file(paths.verified(), text);
}

std::optional<Verified> load_verified(const TakePaths& paths) {
  try {
    Verified verified = parse_verified(read_take_file(paths.verified()), paths.verified());
    if (!is_unchanged(paths, verified.files)) return std::nullopt;
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
  verified.agrees = table.boolean_or("agrees", false);
  for (const TomlTable& file : table.tables("file")) verified.files.push_back(read_entry(file));
  table.reject_unknown_fields();
  return verified;
}

}  // namespace v3d
