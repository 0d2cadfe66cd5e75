// Operations of v3dctl and record_driver for fault injection, each with a check of its results.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "faulty_program.h"

namespace v3d::test {

/// One operation. check() runs without faults and returns one line for each loss.
struct FaultOperation {
  std::string name;
  std::string program;  ///< program that gets the faults; empty: every program
  std::function<void(const FaultyWorkplace&)> prepare;
  std::function<std::vector<std::string>(const FaultyWorkplace&)> command;
  std::function<std::vector<std::string>(const FaultyWorkplace&, const ProgramResult&)> check;
  /// Exit status of a run without faults.
  int done = 0;
  /// Standard output is the same in every run that succeeds.
  bool has_reproducible_output = true;
  /// Standard output is a listing of the take: after a fault that standard error names, it shows
  /// what could be read.
  bool lists_take = false;
  /// With exit status `done`, the operation may have done less, if that loses no data.
  bool may_do_less = false;
  /// The content of its files differs in every run.
  bool makes_other_files = false;
  /// A message that may replace path and cause, because it leads to them; empty: none.
  std::string rejection = {};
};

/// The operation of this name: record, restart, quarantine, verify, recover, reconstruct, collect,
/// collect_rsync, slate, delete, delete_copied, key or serial. `programs`: the folder of the tested
/// v3dctl.
FaultOperation fault_operation(const std::string& name, const std::filesystem::path& programs);

}  // namespace v3d::test
