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
  /// A result on stdout is the same in every run that succeeds.
  bool has_steady_output = true;
};

/// By name: record, restart, quarantine, verify, recover, reconstruct, collect, collect_rsync,
/// slate, delete. `v3dctl`: the folder of the programs that are tested.
FaultOperation fault_operation(const std::string& name, const std::filesystem::path& programs);

}  // namespace v3d::test
