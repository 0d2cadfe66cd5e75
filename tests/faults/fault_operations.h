// The operations whose system calls are made to fail, and what each must leave behind.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "faulty_program.h"

namespace v3d::test {

/// Functions get the workplace; check() runs without faults and returns what was lost, one line
/// each.
struct FaultOperation {
  std::string name;
  std::string program;  ///< in which faults are injected; empty: in every one
  std::function<void(const FaultyWorkplace&)> prepare;
  std::function<std::vector<std::string>(const FaultyWorkplace&)> command;
  std::function<std::vector<std::string>(const FaultyWorkplace&, const ProgramResult&)> check;
  /// Exit status of a run without faults.
  int done = 0;
  /// What it prints is the same in every run that succeeds.
  bool has_steady_output = true;
  /// With status `done` it may have done less, where that loses nothing.
  bool may_do_less = false;
  /// A line that is reported in place of path and cause, and leads to them; may be empty.
  std::string refusal = {};
};

/// By name: record, restart, quarantine, verify, recover, reconstruct, collect, collect_rsync,
/// slate, delete. `programs`: the folder of the v3dctl that is
/// tested.
FaultOperation fault_operation(const std::string& name, const std::filesystem::path& programs);

}  // namespace v3d::test
