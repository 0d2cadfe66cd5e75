// Tests of failed system calls in the daemons. In each run, one call of a real daemon on its files
// fails, alone or with every later call of its family, while the daemon records, rejoins or
// reconstructs a take in a simulated studio.
//
// A run takes two to five seconds, most of which it waits. By default, a sample with a fixed seed
// is run; V3D_FAULTS=all runs all faults. ctest runs the parts of an operation as separate
// programs, each in a network of its own.
#include <gtest/gtest.h>

#include <iostream>
#include <tuple>

#include "daemon_checks.h"
#include "fault_sample.h"
#include "injected_studio.h"

namespace v3d::test {
namespace {

/// Number of injections into one operation, in all parts together.
constexpr size_t kSample = 30;
constexpr size_t kParts = 4;

/// Runs the operation with the fault. Threads and polls make the calls of a run differ: when it has
/// too few for the fault, the fault gets a number that this run has, and is tried once more.
DaemonRun run_with(InjectedStudio& studio, Fault& fault) {
  DaemonRun run = studio.run(fault);
  const auto calls = run.program.calls.find(fault.call);
  if (run.program.fired || calls == run.program.calls.end()) return run;
  fault.number = 1 + fault.number % calls->second;
  return studio.run(fault);
}

class DaemonInjection : public testing::TestWithParam<std::tuple<DaemonOperation, size_t>> {};

TEST_P(DaemonInjection, loses_no_reported_data_and_reports_path_and_cause) {
  const auto [operation, part] = GetParam();
  InjectedStudio studio(operation);
  const DaemonRun clean = studio.run({});
  ASSERT_TRUE(clean.is_done) << clean.program.err << clean.program.out;
  ASSERT_EQ(clean.program.status, 0) << clean.program.out;
  ASSERT_EQ(violations_of(studio, clean, {}), std::vector<std::string>()) << clean.program.out;

  const std::vector<Fault> faults = all_faults(clean.program, "");
  const std::vector<Fault> chosen = share_of(sampled(faults, kSample), part, kParts);
  int fired = 0, bad = 0;
  for (Fault fault : chosen) {
    const DaemonRun run = run_with(studio, fault);
    if (!run.program.fired) continue;
    ++fired;
    const auto found = violations_of(studio, run, fault);
    if (found.empty()) continue;
    ++bad;
    std::string text;
    for (const std::string& line : found) text += "\n  " + line;
    ADD_FAILURE() << text_of(fault) << " on " << run.program.fired_on << text
                  << "\nreplies and events:\n"
                  << run.program.err << "log:\n"
                  << run.program.out;
  }
  std::cout << chosen.size() << " of " << faults.size() << " injections run, " << fired
            << " fired, " << bad << " violations\n";
  EXPECT_GE(10 * fired, 7 * static_cast<int>(chosen.size()));
}

std::string name_of(const testing::TestParamInfo<std::tuple<DaemonOperation, size_t>>& test) {
  const char* const names[] = {"record", "rejoin", "reconstruct"};
  return std::string(names[static_cast<size_t>(std::get<0>(test.param))]) + "_part" +
         std::to_string(std::get<1>(test.param) + 1);
}
INSTANTIATE_TEST_SUITE_P(Faults, DaemonInjection,
                         testing::Combine(testing::Values(DaemonOperation::kRecord,
                                                          DaemonOperation::kRejoin,
                                                          DaemonOperation::kReconstruct),
                                          testing::Range(size_t{0}, kParts)),
                         name_of);

}  // namespace
}  // namespace v3d::test
