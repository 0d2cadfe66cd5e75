// Runs programs with the fault injector preloaded.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "fault_report.h"

namespace v3d::test {

/// One fault to inject. With `number` 0, calls are only counted.
struct Fault {
  std::string call;  ///< family, one of kFaultCalls
  uint32_t number = 0;
  std::string kind;     ///< value of V3D_FAULT_KIND
  std::string program;  ///< program that gets the fault; empty: every started program
  bool lasts = false;   ///< every later call of the family fails too
};

/// Result of one run.
struct ProgramResult {
  int status = 0;  ///< exit status; 128 + signal; -1: killed after three minutes
  std::string out, err;
  std::map<std::string, uint32_t> calls;  ///< number of calls by family
  bool fired = false;                     ///< the fault was injected
  std::string fired_on;                   ///< path of the file of the fault
  /// The power was cut during or after the run: data that was not synced may be lost.
  bool is_power_cut = false;

  /// True when a line of `out` or `err` names a path and contains `cause`.
  bool reports(const std::string& cause) const;
};

/// True when the line names a file and contains `cause`.
bool names_path_and_cause(const std::string& line, const std::string& cause);

/// Environment variables (fault_plan.h) that preload the injector, with its shared memory in the
/// file `report`, for files below `prefix`; and those of one fault.
std::vector<std::string> injector_variables(const std::filesystem::path& prefix,
                                            const std::filesystem::path& report);
std::vector<std::string> variables_of(const Fault& fault);

/// Folder in which a program runs. Faults concern files below `disk()`.
class FaultyWorkplace {
 public:
  /// Creates `root`, which must lie outside any other workplace.
  explicit FaultyWorkplace(std::filesystem::path root);

  std::filesystem::path disk() const { return root_ / "disk"; }
  std::filesystem::path marks() const { return root_ / "marks"; }
  std::filesystem::path trace() const { return root_ / "trace"; }
  /// Empties disk, marks and trace.
  void clear() const;
  /// The lines of the file marks(), up to a power cut.
  std::vector<std::string> marked() const;

  ProgramResult run(const std::vector<std::string>& command, const Fault& fault) const;
  /// Runs without faults; changes below disk() are appended to trace().
  ProgramResult run_traced(const std::vector<std::string>& command) const;

 private:
  ProgramResult run_with(const std::vector<std::string>& command,
                         std::vector<std::string> environment) const;

  const std::filesystem::path root_;
};

/// Copies files and folders below `from` with their times. Throws when a file exists in `to`.
void copy_tree(const std::filesystem::path& from, const std::filesystem::path& to);
/// Contents of all regular files below `folder`, by relative path.
std::map<std::string, std::string> contents_of(const std::filesystem::path& folder);

}  // namespace v3d::test
