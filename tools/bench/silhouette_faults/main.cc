// v3d-silhouette-faults: measures the detection of faulty silhouettes and displaced cameras, and
// the effect of silhouette repair, in simulated studios.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "silhouette_faults/drift_trials.h"
#include "silhouette_faults/fault_trials.h"

namespace {

using namespace v3d::bench;

void print(const std::vector<FaultScore>& scores) {
  std::printf("%-16s %7s %7s %10s %13s %14s %14s\n", "fault", "trials", "found", "innocent",
              "false alarms", "voxels wrong", "when repaired");
  for (const FaultScore& score : scores) {
    std::printf("%-16s %7d %7d %10lld %13lld %14lld %14lld\n", score.kind.c_str(), score.trials,
                score.found, static_cast<long long>(score.innocent),
                static_cast<long long>(score.false_alarms),
                static_cast<long long>(score.wrong_before),
                static_cast<long long>(score.wrong_after));
  }
}

void print(const DriftScore& drift) {
  std::printf("%d studios as calibrated: %d false alarms, largest shift %.2f px\n",
              drift.clean_studios, drift.false_alarms, drift.largest_clean_px);
  std::printf(
      "%d with a camera displaced by 3 px: %d named, %d with another named; shift %.2f to %.2f "
      "px\n",
      drift.displaced_studios, drift.named, drift.others_named, drift.min_px, drift.max_px);
}

}  // namespace

int main(int argc, char** argv) {
  FaultTrialOptions faults;
  DriftTrialOptions drift;
  uint64_t first_seed = 1;
  CLI::App app{
      "Adds faults to the silhouettes of the simulated performer, displaces cameras, and counts "
      "detected and repaired faults."};
  app.add_option("--first-seed", first_seed, "Seed of the first studio; others follow (1)");
  app.add_option("--studios", faults.studios, "Studios with faults in the silhouettes (1)")
      ->check(CLI::Range(0, 10'000));
  app.add_option("--pulses", faults.pulses, "Instants in each of these studios (8)")
      ->check(CLI::Range(1, 10'000));
  app.add_option("--displaced", drift.displaced, "Studios with a displaced camera (24)")
      ->check(CLI::Range(0, 10'000));
  app.add_option("--clean", drift.clean, "Studios without a displaced camera (24)")
      ->check(CLI::Range(0, 10'000));
  app.add_flag("--list", faults.list, "Print every trial");
  CLI11_PARSE(app, argc, argv);
  faults.first_seed = drift.first_seed = first_seed;
  drift.list = faults.list;
  if (faults.studios > 0) print(try_faults(faults));
  if (drift.displaced + drift.clean > 0) print(try_drift(drift));
  return 0;
}
