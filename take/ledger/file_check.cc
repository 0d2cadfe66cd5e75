#include "take/ledger/file_check.h"

#include <algorithm>

#include "base/core/text.h"
#include "take/logs/log_files.h"

namespace v3d::take {

void FileCheck::read_log(const std::filesystem::path& log) {
  const auto segments = existing_segments(log);
  if (!segments) return result_.disagreements.push_back(segments.error().message);
  for (const auto& segment : *segments) read(segment.filename());
}

void FileCheck::finish() {
  const auto names = take_file_names(paths_);
  if (!names) return result_.disagreements.push_back(names.error().message);
  for (const std::string& name : *names) {
    if (name != paths_.verified().filename()) read(name);
  }
  note_foreign_folders();
  std::ranges::sort(result_.files, {}, &TakeFile::name);
  if (!has_list()) return;
  for (const TakeFile& file : stored_->files) {
    if (is_written_after_ledger(file.name)) continue;
    if (!std::ranges::binary_search(*names, file.name)) report_missing(file);
  }
}

void FileCheck::read(const std::string& name) {
  if (!read_.insert(name).second) return;
  // Earlier versions listed skeletons that a recovery found.
  const bool is_listed = has_list() && !is_written_after_ledger(name);
  const TakeFile* const entry = is_listed ? stored_->file(name) : nullptr;
  auto file = read_take_file(paths_, name, from_, entry ? entry->bytes : INT64_MAX);
  if (!file) return report_unreadable(file.error().message);
  if (entry) compare(*entry, *file);
  if (is_listed && !entry) report_unnamed(name);
  result_.files.push_back(*std::move(file));
}

void FileCheck::compare(const TakeFile& entry, const TakeFile& file) {
  if (file.bytes != entry.bytes) {
    disagree(file.name, "has " + format_count(file.bytes) + " bytes, the ledger says " +
                            format_count(entry.bytes));
  } else if (entry.checksum && entry.checksum != file.checksum) {
    disagree(file.name, "has the checksum " + checksum_text(*file.checksum) + ", the ledger says " +
                            checksum_text(*entry.checksum));
  } else if (!entry.checksum) {
    result_.notes.push_back(file.name + ": the ledger has no checksum of it, as after a recovery");
  }
}

/// Reports a log once, though it is read for its events, too.
void FileCheck::report_unreadable(const std::string& line) {
  if (std::ranges::find(result_.disagreements, line) != result_.disagreements.end()) return;
  result_.disagreements.push_back(line);
}

/// Reports a missing file, unless the frame count has already reported it.
void FileCheck::report_missing(const TakeFile& file) {
  const std::string path = (paths_.folder / file.name).string();
  const bool is_known = std::ranges::any_of(result_.disagreements, [&](const std::string& line) {
    return line.find(path) != std::string::npos || line.starts_with(file.name + ": missing");
  });
  if (!is_known) {
    disagree(file.name, "missing; the ledger lists it with " + format_count(file.bytes) + " bytes");
  }
}

void FileCheck::report_unnamed(const std::string& name) {
  const std::string what = "is not named in the ledger";
  if (is_part_of_take(name)) return disagree(name, what + "; move it out of the take");
  result_.notes.push_back(name + ": " + what);
}

void FileCheck::note_foreign_folders() {
  const auto folders = foreign_folders(paths_);
  if (!folders) return result_.disagreements.push_back(folders.error().message);
  for (const std::string& folder : *folders) {
    result_.notes.push_back(folder + "/: is no folder of a take, and is not verified");
  }
}

void FileCheck::disagree(const std::string& name, const std::string& what) {
  result_.disagreements.push_back(name + ": " + what);
}

}  // namespace v3d::take
