#include <memory>

#include "base/core/error.h"
#include "base/image/mask_operations.h"
#include "cli/command.h"
#include "common/console.h"
#include "sim/performer/performer.h"
#include "v3d-sim/performer_file.h"
#include "v3d-sim/sim_commands.h"
#include "v3d-sim/simulated_take.h"

namespace v3d::sim {
namespace {

struct Arguments {
  std::string folder;
  int64_t frames = 0;
  StudioOptions studio;
  double begin_s = 0;
  double outline_noise_px = 0;
  int mask_dilation_px = 0;
  std::string faults;
  std::string truth;
  double colour_spread = 0;
  int performers = 1;
  std::string performer = "swordsman";
  std::string animation;
};

std::vector<Performer> performers_of(const Arguments& arguments) {
  const bool is_duel = arguments.performer == "duel";
  if (is_duel || arguments.performer == "swordsman") {
    if (!arguments.animation.empty()) {
      throw InputError("--animation " + arguments.animation +
                       ": needs --performer FILE.glb, whose animation it names");
    }
    return cast_of(is_duel ? 2 : arguments.performers);
  }
  Performer performer;
  performer.model = load_performer(arguments.performer, arguments.animation);
  return {performer};
}

int run(const Arguments& arguments) {
  SimulatedTake take;
  take.folder = arguments.folder;
  take.rig = rig_of(arguments.studio);
  take.frames = arguments.frames;
  take.rate_hz = arguments.studio.rate_hz;
  take.seed = arguments.studio.seed;
  take.begin_s = arguments.begin_s;
  take.outline_noise_px = arguments.outline_noise_px;
  take.mask_dilation_px = arguments.mask_dilation_px;
  take.colour_spread = arguments.colour_spread;
  take.cast = performers_of(arguments);
  if (!arguments.faults.empty()) {
    take.faults = load_faults(arguments.faults, take.rig, take.frames);
  }
  if (!arguments.truth.empty()) {
    take.truth = arguments.truth;
  }
  Progress progress("simulate", take.frames);
  write_take(take, [&](int64_t) { progress.advance(); });
  return kExitDone;
}

}  // namespace

void add_take_command(cli::Command app, int& status) {
  cli::Command command =
      app.add_subcommand("take", "Write a take like a recording of the studio, without daemons");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("OUT_TAKE", arguments->folder, "Folder of the take, new or empty").required();
  command.add_option("--frames", arguments->frames, "Number of pulses")
      .required()
      .check(cli::integer_in(1, 10'000'000));
  add_studio_options(command, arguments->studio);
  command.add_option("--begin", arguments->begin_s, "Start time within the action")
      .type_name("SECONDS")
      .check(cli::number_in(0, 1e6));
  command
      .add_option("--outline-noise", arguments->outline_noise_px,
                  "Write masks with outline noise of this standard deviation")
      .type_name("PIXELS")
      .check(cli::number_in(0, 20));
  command
      .add_option("--dilate-masks", arguments->mask_dilation_px,
                  "Write masks with this many pixels of the room on every side")
      .type_name("PIXELS")
      .check(cli::integer_in(0, kMaxRadius));
  command.add_option(
      "--faults", arguments->faults,
      "TOML file: [[fault]] camera, pulse, kind = drop|duplicate|black|suspect|late; see "
      "v3d-sim(1)");
  command.add_option(
      "--truth", arguments->truth,
      "Folder for the truth: the surface of every pulse, 000000.ply ...; that of the "
      "blade of the sword, sword/000000.ply ...; points that stay at their place of "
      "the surface, points/000000.ply ...; the joints, joints.json; of two "
      "performers also performer1/000000.ply ... and performer2/000000.ply ...");
  command
      .add_option("--colour-spread", arguments->colour_spread,
                  "Colour difference between the cameras: 1 is 15 %, as of unmatched cameras")
      .check(cli::number_in(0, 4));
  const cli::Option performers =
      command
          .add_option("--performers", arguments->performers,
                      "1: a swordsman alone; 2: two performers that fight and touch each other")
          .check(cli::integer_in(1, 2))
          .show_default();
  command
      .add_option(
          "--performer", arguments->performer,
          "swordsman; duel: two performers that fight, as --performers 2; or a glTF file with a "
          "skinned, animated body, which moves at its place")
      .type_name("swordsman|duel|FILE")
      .show_default()
      .excludes(performers);
  command
      .add_option("--animation", arguments->animation,
                  "Name of the animation of the file; the first one by default")
      .type_name("NAME");
  command.footer(
      "Examples:\n"
      "  v3d-sim take takes/cut-01 --frames 100\n"
      "  v3d-sim take takes/small --frames 3 --cameras 6 --size 320x240 --truth takes/small-truth\n"
      "  v3d-sim take takes/broken --frames 20 --faults faults.toml\n"
      "  v3d-sim take takes/walk --frames 25 --performer walking.glb --animation Walk");
  command.on_parsed([arguments, &status] { status = run(*arguments); });
}

}  // namespace v3d::sim
