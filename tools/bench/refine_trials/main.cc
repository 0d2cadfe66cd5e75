// v3d-refine-trials: tests `v3dctl calibrate refine` on simulated rigs with known calibration
// errors.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "refine_trials/trials.h"

int main(int argc, char** argv) {
  using namespace v3d::bench;
  RefineTrials trials;
  CLI::App app{
      "Disturbs the cameras of simulated studios by 0 to 4 pixels, refines them by the performer's "
      "silhouettes, and compares the result with the truth."};
  app.add_option("--studios", trials.studios, "Studios for every line of the table (6)");
  app.add_option("--instants", trials.instants, "Instants in each (30)");
  app.add_option("--cameras", trials.cameras, "Cameras in each (15)");
  CLI11_PARSE(app, argc, argv);
  std::printf("%-12s %9s %10s %10s %10s %8s %16s\n", "silhouettes", "off by", "before", "after",
              "worst", "changed", "planes disagree");
  for (const RefineScore& s : try_refining(trials)) {
    std::printf("%-12s %6.1f px %7.2f px %7.2f px %7.2f px %3d of %d %6.2f, %5.2f px\n",
                s.segmented ? "segmented" : "true", s.disturbed_px, s.before_px, s.after_px,
                s.worst_px, s.changed, trials.studios, s.planes_before_px, s.planes_after_px);
  }
  return 0;
}
