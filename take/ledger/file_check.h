// FileCheck: the part of a verification that compares the files of a take with its ledger.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/take.h"

namespace v3d::take {

/// Reads the files of a take and compares them with the file list of its ledger. Reads each file
/// once, also after an error. One thread.
class FileCheck {
 public:
  /// `stored`: the ledger; null when it cannot be read. `result` gets the files, disagreements and
  /// notes. All must outlive the object.
  FileCheck(const TakePaths& paths, const Ledger* stored, ReadFrom from, Verification& result)
      : paths_(paths), stored_(stored), from_(from), result_(result) {}

  /// Reads all segments of a log. Later readers find them in the page cache.
  void read_log(const std::filesystem::path& log);
  /// Reads all other files. Reports files that are missing, files that the ledger does not list,
  /// and foreign_folders().
  void finish();

 private:
  bool has_list() const { return stored_ && !stored_->files.empty(); }
  void read(const std::string& name);
  void compare(const TakeFile& entry, const TakeFile& file);
  void report_unreadable(const std::string& line);
  void report_missing(const TakeFile& file);
  void report_unnamed(const std::string& name);
  void note_foreign_folders();
  void disagree(const std::string& name, const std::string& what);

  const TakePaths& paths_;
  const Ledger* const stored_;
  const ReadFrom from_;
  std::set<std::string> read_;  ///< names of the files that read() was called for
  Verification& result_;
};

}  // namespace v3d::take
