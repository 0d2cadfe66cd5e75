// Runs a program with the fault injector preloaded.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "fault_report.h"

namespace v3d::test {

/// One injection; with `number` 0 calls are counted only.
struct Fault {
  std::string call;  ///< of kFaultCalls
  uint32_t number = 0;
  std::string kind;     ///< as V3D_FAULT_KIND
  std::string program;  ///< only there; empty: in every program that is started
  bool lasts = false;   ///< every later call of the family fails as well
};

struct ProgramResult {
  int status = 0;  ///< exit status; 128 + signal; -1: it did not end in time, and was killed
  std::string out, err;
  std::map<std::string, uint32_t> calls;
  bool fired = false;
  std::string fired_on;
  /// The power was cut during the run or after it: data that was not synced may be lost.
  bool is_power_cut = false;

  /// Some line of either stream names a path and holds `cause`.
  bool tells(const std::string& cause) const;
};

/// Where a program runs: `disk()` is the prefix of its faults.
class FaultyWorkplace {
 public:
  /// `root` is made, and must be outside of any other workplace.
  explicit FaultyWorkplace(std::filesystem::path root);

  std::filesystem::path disk() const { return root_ / "disk"; }
  std::filesystem::path marks() const { return root_ / "marks"; }
  std::filesystem::path trace() const { return root_ / "trace"; }
  /// Empties disk, marks and trace.
  void clear() const;
  /// The lines of the marks.
  std::vector<std::string> marked() const;

  ProgramResult run(const std::vector<std::string>& command, const Fault& fault) const;
  /// Without faults; changes below disk() are appended to trace().
  ProgramResult run_traced(const std::vector<std::string>& command) const;

 private:
  ProgramResult run_with(const std::vector<std::string>& command,
                         std::vector<std::string> environment) const;

  const std::filesystem::path root_;
};

/// Files and folders below `from`, with their times; replaces nothing.
void copy_tree(const std::filesystem::path& from, const std::filesystem::path& to);
/// Contents of all regular files below, by relative path.
std::map<std::string, std::string> contents_of(const std::filesystem::path& folder);

}  // namespace v3d::test
