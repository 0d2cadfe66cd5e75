// Tests of failed system calls. Each run makes one call of an operation on its files fail, alone or
// with every later call of its family. The operation loses no recorded data and reports the
// failure.
//
// A run takes about 30 ms. By default, a sample with a fixed seed is run. V3D_FAULTS=all runs all
// faults; V3D_FAULT_BIN=FOLDER tests other programs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <random>
#include <set>

#include "fault_operations.h"
#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

/// Number of injections of one operation.
constexpr size_t kSample = 40;

const std::set<std::string> kTransfers = {"read",   "pread",   "write", "writev",
                                          "pwrite", "pwritev", "copy"};
const std::set<std::string> kAllocating = {"open",    "write",    "writev",    "pwrite",
                                           "pwritev", "mkdir",    "link",      "rename",
                                           "copy",    "truncate", "fallocate", "fsync"};

std::vector<std::string> kinds_of(const std::string& call) {
  std::vector<std::string> kinds = {"EIO"};
  if (kAllocating.contains(call)) kinds.emplace_back("ENOSPC");
  if (call == "open" || call == "opendir") kinds.emplace_back("EMFILE");
  if (kTransfers.contains(call)) kinds.insert(kinds.end(), {"EINTR", "SHORT"});
  if (call == "open" || call == "fsync") kinds.emplace_back("EINTR");
  return kinds;
}

/// True for EINTR and short transfers: the operation repeats the call or continues. rsync reports
/// EINTR as an error.
bool must_succeed(const Fault& fault) {
  return fault.program != "rsync" && (fault.kind == "EINTR" || fault.kind == "SHORT");
}

std::string cause_of(const Fault& fault) {
  if (fault.kind == "ENOSPC") return std::strerror(ENOSPC);
  if (fault.kind == "EMFILE") return std::strerror(EMFILE);
  return std::strerror(fault.kind == "EINTR" ? EINTR : EIO);
}

/// True when a line names path and cause. A line about the same file or folder is accepted too: the
/// next call on it may have failed with another cause. The name of a folder alone is not enough,
/// because it is part of most paths.
bool is_reported(const ProgramResult& result, const Fault& fault) {
  const std::filesystem::path hit = result.fired_on;
  return result.reports(cause_of(fault)) || result.reports(hit.string() + ": ") ||
         (!std::filesystem::is_directory(hit) && result.reports(hit.filename()));
}

std::vector<Fault> all_faults(const ProgramResult& counted, const std::string& program) {
  std::vector<Fault> faults;
  for (const auto& [call, count] : counted.calls) {
    for (uint32_t number = 1; number <= count; ++number) {
      for (const std::string& kind : kinds_of(call)) {
        faults.push_back({call, number, kind, program});
        // EINTR does not last: programs repeat an interrupted call without limit.
        if (kind != "EINTR") faults.push_back({call, number, kind, program, true});
      }
    }
  }
  return faults;
}

std::vector<Fault> sampled(std::vector<Fault> faults) {
  const char* const wanted = std::getenv("V3D_FAULTS");
  if (wanted != nullptr && std::string(wanted) == "all") return faults;
  std::shuffle(faults.begin(), faults.end(), std::mt19937(2009));
  faults.resize(std::min(faults.size(), kSample));
  return faults;
}

/// True for caches and temporary files: they may be missing, or remain after a run.
bool is_auxiliary(const std::string& file) {
  const std::string name = std::filesystem::path(file).filename();
  return name.starts_with(".") || name == "verified.toml" || name.ends_with(".index") ||
         name.find(".part-") != std::string::npos || file.find("/.") != std::string::npos;
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
    const std::vector<std::string> differences = differences_to_clean_run(result);
    const bool is_done = differences.empty() && result.status == operation_.done;
    if (must_succeed(fault) && !is_done)
      found.emplace_back("did not continue after EINTR or a short transfer");
    if (must_succeed(fault) || (result.status == 0 && !operation_.may_do_less)) {
      found.insert(found.end(), differences.begin(), differences.end());
    }
    const bool is_rejected = !operation_.rejection.empty() && result.reports(operation_.rejection);
    if (!is_done && !operation_.may_do_less && !is_rejected && !is_reported(result, fault)) {
      found.emplace_back("no line with path and cause");
    }
    if (!found.empty()) found.push_back("stderr: " + result.err + "stdout: " + result.out);
    return found;
  }

  /// A run with exit status 0 must have the same result as a run without faults.
  std::vector<std::string> differences_to_clean_run(const ProgramResult& result) const {
    std::vector<std::string> found;
    if (operation_.has_reproducible_output && result.out != clean_.out) {
      found.emplace_back("succeeded, but stdout differs");
    }
    const auto files = contents_of(place_.disk());
    for (const auto& [file, content] : clean_files_) {
      if (is_auxiliary(file)) continue;
      const auto same = files.find(file);
      if (same == files.end() || same->second != content) {
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
  const std::vector<Fault> chosen = sampled(faults);
  int bad = 0;
  for (const Fault& fault : chosen) {
    const std::vector<std::string> found = violations(fault);
    if (found.empty()) continue;
    ++bad;
    std::string text;
    for (const std::string& line : found) text += "\n  " + line;
    ADD_FAILURE() << operation_.name << ": " << fault.call << " " << fault.number << " "
                  << fault.kind << (fault.lasts ? " and all later calls" : "") << " on " << hit_
                  << text;
  }
  std::cout << operation_.name << ": " << chosen.size() << " of " << faults.size()
            << " injections run, " << fired_ << " fired, " << bad << " violations\n";
  // Concurrent programs do not always make the same calls.
  EXPECT_GE(10 * fired_, 9 * static_cast<int>(chosen.size()));
}

INSTANTIATE_TEST_SUITE_P(Faults, Injection,
                         testing::Values("record", "restart", "quarantine", "verify", "recover",
                                         "reconstruct", "collect", "collect_rsync", "slate",
                                         "delete", "delete_copied"),
                         [](const auto& operation) { return operation.param; });

}  // namespace
}  // namespace v3d::test
