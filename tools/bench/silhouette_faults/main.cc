// v3d-silhouette-faults: how well faulty silhouettes and knocked cameras are found, and what
// mending is worth, in simulated studios.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "silhouette_faults/drift_trials.h"
#include "silhouette_faults/fault_trials.h"

int main(int argc, char** argv) {
  using namespace v3d::bench;
  int pulses = 8;
  int studios = 24;
  CLI::App app{
      "Puts faults into the silhouettes of the simulated performer and knocks cameras, and counts "
      "what is found and what is mended."};
  app.add_option("--pulses", pulses, "Instants with faults in the silhouettes (8)")
      ->check(CLI::Range(0, 10'000));
  app.add_option("--studios", studios, "Studios with and without a knocked camera (24)")
      ->check(CLI::Range(0, 10'000));
  CLI11_PARSE(app, argc, argv);
  std::printf("%-16s %7s %7s %13s %14s %14s\n", "fault", "trials", "found", "false alarms",
              "voxels wrong", "when mended");
  for (const FaultScore& score : try_faults(pulses)) {
    std::printf("%-16s %7d %7d %13d %14lld %14lld\n", score.kind.c_str(), score.trials, score.found,
                score.false_alarms, static_cast<long long>(score.wrong_before),
                static_cast<long long>(score.wrong_after));
  }
  const DriftScore drift = try_drift(studios);
  std::printf("\n%d studios as calibrated: %d false alarms, largest shift %.2f px\n",
              drift.clean_studios, drift.false_alarms, drift.largest_clean_px);
  std::printf("%d with a camera 3 px aside: %d named, shift %.2f to %.2f px\n",
              drift.knocked_studios, drift.named, drift.least_px, drift.most_px);
  return 0;
}
