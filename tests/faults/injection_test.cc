// Tests of failed system calls. Each run makes one call of an operation on its files fail, alone or
// with every later call of its family. The operation loses no recorded data and reports the
// failure.
//
// A run takes about 30 ms. By default, a sample with a fixed seed is run. V3D_FAULTS=all runs all
// faults; V3D_FAULT_BIN=FOLDER tests other programs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <sstream>

#include "fault_operations.h"
#include "fault_sample.h"
#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

/// Number of injections of one operation.
constexpr size_t kSample = 60;

/// Faults that a run with all faults found, by operation; they are always injected.
const std::multimap<std::string, Fault> kFoundFaults = {
    // rsync left out a take whose folder it could not examine, and reported success.
    {"collect_rsync", {.call = "stat", .number = 3, .kind = "EIO", .program = "rsync"}},
};

/// True for caches and temporary files: they may be missing, or remain after a run.
bool is_auxiliary(const std::string& file) {
  const std::string name = std::filesystem::path(file).filename();
  return name.starts_with(".") || name == "verified.toml" || name.ends_with(".index") ||
         name.find(".part-") != std::string::npos || file.find("/.") != std::string::npos;
}

/// True for signatures, which hold the time and a new key.
bool is_signature(const std::string& file) {
  return std::filesystem::path(file).filename().string().starts_with("signature.");
}

class Injection : public testing::TestWithParam<std::string> {
 protected:
  void count() {
    clean_ = run({.call = {}, .number = 0, .kind = {}, .program = operation_.program});
    ASSERT_EQ(clean_.status, operation_.done) << clean_.out << clean_.err;
    clean_files_ = contents_of(place_.disk());
    ASSERT_EQ(operation_.check(place_, clean_), std::vector<std::string>());
  }

  ProgramResult run(const Fault& fault) {
    place_.clear();
    operation_.prepare(place_);
    std::filesystem::remove(place_.marks());
    return place_.run(operation_.command(place_), fault);
  }

  /// Runs the operation with one fault. Returns the broken rules, one line each.
  std::vector<std::string> violations(const Fault& fault) {
    const ProgramResult result = run(fault);
    if (!result.fired) return {};  // concurrent programs make their calls in another order
    ++fired_;
    hit_ = result.fired_on;
    std::vector<std::string> found = operation_.check(place_, result);
    if (result.status < 0 || result.status > 3) {
      found.push_back("exit status " + std::to_string(result.status));
    }
    const std::vector<std::string> differences = differences_to_clean_run(result, cause_of(fault));
    const bool is_done = differences.empty() && result.status == operation_.done;
    if (must_succeed(fault) && !is_done)
      found.emplace_back("did not continue after EINTR or a short transfer");
    if (must_succeed(fault) || (result.status == 0 && !operation_.may_do_less)) {
      found.insert(found.end(), differences.begin(), differences.end());
    }
    const bool is_rejected =
        !operation_.rejection.empty() &&
        (result.err + result.out).find(operation_.rejection) != std::string::npos;
    if (!is_done && !operation_.may_do_less && !is_rejected && !result.reports(cause_of(fault))) {
      found.emplace_back("no line with path and cause");
    }
    if (!found.empty()) found.push_back("stderr: " + result.err + "stdout: " + result.out);
    return found;
  }

  /// A run with exit status 0 must have the same result as a run without faults. Its output may
  /// have further lines that name a file and `cause`. A listing may differ when standard error has
  /// such a line.
  std::vector<std::string> differences_to_clean_run(const ProgramResult& result,
                                                    const std::string& cause) const {
    std::vector<std::string> found;
    const bool may_differ_in_output =
        operation_.lists_take && without_reports(result.err, cause) != result.err;
    if (operation_.has_reproducible_output && !may_differ_in_output &&
        without_reports(result.out, cause) != clean_.out) {
      found.emplace_back("succeeded, but stdout differs");
    }
    const auto files = contents_of(place_.disk());
    for (const auto& [file, content] : clean_files_) {
      if (is_auxiliary(file)) continue;
      const auto same = files.find(file);
      const bool may_differ = operation_.makes_other_files || is_signature(file);
      if (same == files.end() || (!may_differ && same->second != content)) {
        found.push_back("succeeded, but " + file + " is missing or differs");
      }
    }
    for (const auto& [file, content] : files) {
      if (!clean_files_.contains(file) && !is_auxiliary(file)) {
        found.push_back("succeeded, but left " + file);
      }
    }
    return found;
  }

  /// `text` without the lines that name a file and `cause`; all of it when the fault has no cause.
  static std::string without_reports(const std::string& text, const std::string& cause) {
    std::istringstream lines(text);
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
      if (cause.empty() || !names_path_and_cause(line, cause)) kept += line + "\n";
    }
    return kept;
  }

  static std::filesystem::path programs() {
    const char* const other = std::getenv("V3D_FAULT_BIN");
    return other != nullptr ? other : V3D_BIN;
  }

  const TemporaryFolder folder_{"/dev/shm"};
  const FaultyWorkplace place_{folder_.path()};
  const FaultOperation operation_ = fault_operation(GetParam(), programs());
  ProgramResult clean_;
  std::map<std::string, std::string> clean_files_;
  int fired_ = 0;
  std::string hit_;
};

TEST_P(Injection, loses_no_data_and_reports_one_failed_system_call) {
  ASSERT_NO_FATAL_FAILURE(count());
  const std::vector<Fault> faults = all_faults(clean_, operation_.program);
  std::vector<Fault> chosen = sampled(faults, kSample);
  const auto [found, end] = kFoundFaults.equal_range(operation_.name);
  std::for_each(found, end, [&](const auto& fault) { chosen.push_back(fault.second); });
  int bad = 0;
  for (const Fault& fault : chosen) {
    const std::vector<std::string> broken = violations(fault);
    if (broken.empty()) continue;
    ++bad;
    std::string text;
    for (const std::string& line : broken) text += "\n  " + line;
    ADD_FAILURE() << operation_.name << ": " << text_of(fault) << " on " << hit_ << text;
  }
  std::cout << operation_.name << ": " << chosen.size() << " of " << faults.size()
            << " injections run, " << fired_ << " fired, " << bad << " violations\n";
  // Concurrent programs do not always make the same calls.
  EXPECT_GE(10 * fired_, 9 * static_cast<int>(chosen.size()));
}

TEST(FaultInjector, lets_a_signal_handler_write_to_an_eventfd_while_its_thread_allocates) {
  const TemporaryFolder folder("/dev/shm");
  const FaultyWorkplace place(folder.path());
  const ProgramResult result = place.run({V3D_SIGNAL_DRIVER}, {"write", 1, "EIO", "", true});
  EXPECT_EQ(result.status, 0);
  EXPECT_FALSE(result.fired) << result.fired_on;
}

INSTANTIATE_TEST_SUITE_P(Faults, Injection,
                         testing::Values("record", "restart", "quarantine", "verify", "recover",
                                         "reconstruct", "collect", "collect_rsync", "slate",
                                         "delete", "delete_copied", "key", "serial"),
                         [](const auto& operation) { return operation.param; });

}  // namespace
}  // namespace v3d::test
