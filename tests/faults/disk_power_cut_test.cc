// Tests of power cuts on an ext4 file system. Each run cuts the power before one change of an
// operation, or after the last one. After a restart, all data that the operation reported is there.
//
// A run takes about 150 ms. By default, a sample with a fixed seed is run; V3D_POWER_CUTS=all runs
// all.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <random>
#include <set>

#include "base/io/file.h"
#include "fault_operations.h"
#include "power_cut_disk.h"
#include "support/temporary_folder.h"
#include "update_operation.h"

namespace v3d::test {
namespace {

constexpr size_t kSample = 25;

/// Families of calls that change the content of a disk, or wait for the disk.
const std::set<std::string> kChanges = {
    "write",  "writev", "pwrite", "pwritev", "copy",  "fallocate", "truncate",       "link",
    "rename", "unlink", "rmdir",  "mkdir",   "fsync", "syncfs",    "sync_file_range"};

/// All power cuts before a change of the run `counted`.
std::vector<Fault> all_cuts(const ProgramResult& counted, const std::string& program) {
  std::vector<Fault> cuts;
  for (const auto& [call, count] : counted.calls) {
    if (!kChanges.contains(call)) continue;
    for (uint32_t n = 1; n <= count; ++n) cuts.push_back({call, n, "POWER_CUT", program});
  }
  return cuts;
}

std::vector<Fault> sampled(std::vector<Fault> cuts) {
  const char* const wanted = std::getenv("V3D_POWER_CUTS");
  if (wanted == nullptr || std::string(wanted) != "all") {
    std::shuffle(cuts.begin(), cuts.end(), std::mt19937(2009));
    cuts.resize(std::min(cuts.size(), kSample));
  }
  cuts.emplace_back();  // without a call: the cut after the program has ended
  return cuts;
}

class PowerCut : public testing::TestWithParam<const char*> {
 protected:
  static void SetUpTestSuite() {
    static const std::string problem = create_mount_namespace();
    problem_ = &problem;
  }
  void SetUp() override {
    if (!problem_->empty()) GTEST_SKIP() << *problem_;
  }

  static inline const std::string* problem_ = nullptr;
};

TEST_P(PowerCut, before_any_change_keeps_all_reported_data) {
  const std::string name = GetParam();
  const FaultOperation operation =
      name == "update" ? update_operation() : fault_operation(name, V3D_BIN);
  const TemporaryFolder folder{"/dev/shm"};
  const FaultyWorkplace place(folder.path() / "place");
  PowerCutDisk disk(folder / "files", place.disk());
  operation.prepare(place);
  disk.save();
  const std::string marks = std::filesystem::exists(place.marks())
                                ? read_file(place.marks()) + "synced\n"
                                : std::string();
  const ProgramResult counted = place.run(operation.command(place), {});
  ASSERT_EQ(counted.status, operation.done) << counted.out << counted.err;

  int cuts = 0, bad = 0;
  for (const Fault& cut : sampled(all_cuts(counted, operation.program))) {
    write_text(place.marks(), marks);
    disk.restore();
    ProgramResult result = place.run(operation.command(place), cut);
    if (result.fired == cut.call.empty()) continue;  // threads: a run may make fewer calls
    if (!result.fired) disk.cut_power();
    result.is_power_cut = true;
    disk.restart();
    ++cuts;
    const auto lost = operation.check(place, result);
    if (lost.empty()) continue;
    ++bad;
    std::string text;
    for (const std::string& line : lost) text += "\n  " + line;
    ADD_FAILURE() << GetParam() << ": power cut before " << cut.call << " " << cut.number << " on "
                  << result.fired_on << text << "\n"
                  << result.out << result.err;
  }
  EXPECT_GE(cuts, 3);
  std::cout << GetParam() << ": " << cuts << " power cuts, " << bad << " violations\n";
}

INSTANTIATE_TEST_SUITE_P(Ext4, PowerCut,
                         testing::Values("record", "restart", "quarantine", "verify", "recover",
                                         "reconstruct", "collect", "collect_rsync", "slate",
                                         "delete", "delete_copied", "key", "serial", "update"),
                         [](const auto& operation) { return std::string(operation.param); });

}  // namespace

}  // namespace v3d::test
