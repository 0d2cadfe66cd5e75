#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>

#include "base/config/calib_file.h"
#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "base/io/process.h"
#include "common/console.h"
#include "sim/cameras/exposure_record.h"
#include "sim/cameras/gige_cameras.h"
#include "sim/cameras/triggers.h"
#include "sim/performer/performer.h"
#include "sim/rendering/camera_images.h"
#include "v3d-sim/sim_commands.h"
#include "v3d-sim/simulated_take.h"
#include "wire/secret_keys.h"

namespace v3d::sim {
namespace {

constexpr int kPlates = 8;

struct Arguments {
  std::string folder;
  StudioOptions studio;
  int performers = 1;
  int64_t loop_frames = 0;
  int64_t empty_pulses = 0;
  std::string voxel = "10mm";
  std::string faults;
  std::string format = "BayerRG8";
  std::string flicker;
  std::string trigger = "cable";  ///< or "action"
  bool has_no_ptp = false;        ///< the cameras find no PTP master
  double clap = 0;                ///< pulse at which the performer stops; 0: never
};

/// A format with the filter pattern of the rendered images.
CameraFormat read_format(const std::string& name) {
  const auto format = camera_format_from_name(name);
  const bool is_known =
      format && pfnc_code(*format) && reduced_to_8_bits(format->image) == PixelFormat::kBayerRG8;
  if (is_known) return *format;
  throw InputError("--format " + name +
                   ": expected BayerRG8, or a 10 or 12 bit format such as BayerRG12Packed");
}

/// Parses "0.05@120": amplitude and frequency.
LampFlicker read_flicker(const std::string& text) {
  if (text.empty()) return {};
  LampFlicker lamps;
  char rest = 0;
  const int read = std::sscanf(text.c_str(), "%lf@%lf%c", &lamps.amplitude, &lamps.hz, &rest);
  if (read == 2 && lamps.amplitude >= 0 && lamps.amplitude <= 1 && lamps.hz > 0) return lamps;
  throw InputError("--flicker " + text + ": expected AMPLITUDE@HZ, like 0.05@120");
}

/// Blocks SIGTERM and SIGINT in all threads; the program polls them or waits for them.
class StopSignals {
 public:
  StopSignals() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGTERM);
    sigaddset(&signals_, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }
  bool arrived() const {
    const timespec now{};
    return sigtimedwait(&signals_, nullptr, &now) > 0;
  }
  void wait() const {
    int signal = 0;
    sigwait(&signals_, &signal);
  }

 private:
  sigset_t signals_;
};

/// All images of the studio, rendered in advance, and their order by edges.
struct RenderedImages {
  std::vector<std::vector<Image>> plates;  ///< [i][camera]: the empty studio, with different noise
  std::vector<std::vector<Image>> loop;    ///< [i][camera]: the performer
  int64_t repeated_from = 0;               ///< the images from here on are repeated
  std::map<const Image*, uint64_t> checksums{};  ///< of the bytes of all images

  int64_t image_index(int64_t edge, int64_t empty_pulses) const {
    const int64_t index = edge - empty_pulses;
    if (index < 0) return -1;
    if (index < repeated_from) return index;
    return repeated_from + (index - repeated_from) % (std::ssize(loop) - repeated_from);
  }
  const Image& picture(int camera, int64_t edge, int64_t empty_pulses) const {
    const int64_t index = image_index(edge, empty_pulses);
    const auto& images =
        index < 0 ? plates[static_cast<size_t>(edge % kPlates)] : loop[static_cast<size_t>(index)];
    return images[static_cast<size_t>(camera)];
  }
  /// Once for each image: the cameras send it many times.
  void add_checksums() {
    for (const auto* const images : {&plates, &loop}) {
      for (const std::vector<Image>& of_rig : *images) {
        for (const Image& image : of_rig) checksums[&image] = checksum({image.bytes});
      }
    }
  }
};

/// The checksum of a sent image, as v3d-sim check compares it; 0 when it is not known.
uint64_t sent_checksum(const Exposure& exposure, const RenderedImages& rendered,
                       const Arguments& arguments) {
  const Image& image = rendered.picture(exposure.camera, exposure.edge, arguments.empty_pulses);
  if (exposure.black) return checksum({std::vector<uint8_t>(image.bytes.size())});
  if (!arguments.flicker.empty()) return 0;
  return rendered.checksums.at(&image);
}

/// Empty when a signal arrives before the end.
std::optional<RenderedImages> render_all_images(const Rig& rig, const Arguments& arguments,
                                                const StopSignals& stop) {
  const int64_t total = kPlates + arguments.loop_frames;
  require_memory(rig, total, available_memory(), arguments.studio.rig);
  RenderOptions options;
  options.seed = arguments.studio.seed;
  options.cast = cast_of(arguments.performers);
  BatchRenderer renderer(rig, options);
  RenderedImages rendered;
  if (arguments.clap > 0) rendered.repeated_from = arguments.loop_frames - kPlates;
  Progress progress("render", total);
  for (int64_t i = 0; i < total; ++i) {
    if (stop.arrived()) {
      return {};
    }
    if (i < kPlates) {
      rendered.plates.push_back(renderer.render_all({}, static_cast<uint64_t>(i)));
    } else {
      auto pulse = static_cast<double>(i - kPlates);
      if (arguments.clap > 0) pulse = std::min(pulse, arguments.clap);
      const double seconds = pulse / arguments.studio.rate_hz;
      rendered.loop.push_back(renderer.render_all(seconds, static_cast<uint64_t>(i)));
    }
    progress.advance();
  }
  rendered.add_checksums();
  return rendered;
}

std::vector<GigeCamera> network_cameras(const Rig& rig, const std::vector<Fault>& faults,
                                        const Arguments& arguments) {
  const MonotonicInstant origin = Monotonic::now();
  std::vector<GigeCamera> cameras;
  for (int i = 0; i < static_cast<int>(rig.size()); ++i) {
    const RigCamera& camera = rig[static_cast<size_t>(i)];
    cameras.push_back({gige_address(i), gige_serial(i), camera.model.size(),
                       read_format(arguments.format),
                       simulated_clock(i, arguments.studio.seed, origin),
                       faults_at_edges(faults, camera.name, arguments.empty_pulses),
                       read_flicker(arguments.flicker), !arguments.has_no_ptp});
  }
  return cameras;
}

int run(Arguments arguments) {
  const StopSignals stop;  // before any thread, so that all inherit the mask
  const std::filesystem::path folder = arguments.folder;
  const double rate = arguments.studio.rate_hz;
  if (arguments.clap > 0) {
    // The images of the motion, and some of the performer who stands, with different noise.
    arguments.loop_frames = static_cast<int64_t>(std::ceil(arguments.clap)) + kPlates;
  } else if (arguments.loop_frames == 0) {
    arguments.loop_frames = std::max(1L, std::lround(kActionPeriodSeconds * rate));
  }
  const Rig rig = rig_of(arguments.studio);
  const std::vector<Fault> faults =
      arguments.faults.empty() ? std::vector<Fault>() : load_faults(arguments.faults, rig, {});
  read_flicker(arguments.flicker);  // rejects it before the images are rendered
  const StudioText text{rate, parse_length(arguments.voxel),
                        std::string(name(read_format(arguments.format))),
                        arguments.trigger == "action"};
  std::filesystem::create_directories(folder);
  require_own_studio(folder);
  save_calib(folder / "calib.toml", rig);
  replace_file(folder / "studio.toml", studio_text(rig, text));
  if (!std::filesystem::exists(folder / "studio.key"))
    wire::StudioKey::make().save(folder / "studio.key");

  const std::optional<RenderedImages> rendered = render_all_images(rig, arguments, stop);
  if (!rendered) {
    return kExitDone;
  }
  ExposureRecord record(folder / "exposures.csv");
  const int64_t empty = arguments.empty_pulses;
  GigeCameras cameras(
      network_cameras(rig, faults, arguments),
      [&](int camera, int64_t edge) {
        return std::span<const uint8_t>(rendered->picture(camera, edge, empty).bytes);
      },
      [&](const Exposure& e) {
        record.add({rig[static_cast<size_t>(e.camera)].name, e.device_time, e.edge_time, e.edge,
                    e.black ? kBlackImage : rendered->image_index(e.edge, empty),
                    sent_checksum(e, *rendered, arguments)});
      },
      arguments.studio.seed);
  const TriggerCable cable(folder / "trigger.sock", [&](int64_t edge, MonotonicInstant edge_time) {
    cameras.trigger(edge, edge_time);
  });
  std::puts("ready");
  std::fflush(stdout);
  stop.wait();
  fmt::print(stderr, "{} edges, {} of them ignored by a camera that was not acquiring\n",
             cable.edges() + cameras.actions(), cameras.ignored());
  return record.lost() == 0 ? kExitDone : kExitFailed;
}

}  // namespace

void add_studio_command(cli::Command app, int& status) {
  cli::Command command = app.add_subcommand(
      "studio", "Serve a simulated studio: cameras on the network and a trigger cable");
  auto arguments = std::make_shared<Arguments>();
  command
      .add_option("DIR", arguments->folder,
                  "Folder for studio.toml, calib.toml, trigger.sock and exposures.csv")
      .required();
  add_studio_options(command, arguments->studio);
  command
      .add_option("--performers", arguments->performers,
                  "1: a swordsman alone; 2: two performers that fight and touch each other")
      .check(cli::integer_in(1, 2))
      .show_default();
  command
      .add_option("--loop-frames", arguments->loop_frames,
                  "Images of the performer per camera, rendered in advance and sent in a loop; "
                  "default: 4 s of action, one period")
      .check(cli::integer_in(1, 100'000));
  command
      .add_option("--empty-pulses", arguments->empty_pulses,
                  "Number of first pulses that show the empty studio")
      .check(cli::integer_in(0, 1'000'000))
      .show_default();
  command.add_option("--voxel", arguments->voxel, "Voxel size for studio.toml, with a unit")
      .show_default();
  command
      .add_option(
          "--format", arguments->format,
          "Pixel format that the cameras send; with 10 or 12 bits the low bits count pixels")
      .show_default();
  command.add_option("--flicker", arguments->flicker,
                     "Lamps that flicker, AMPLITUDE@HZ: 0.05@120 varies the light by 5 % up and "
                     "down, 120 times a second");
  command
      .add_option("--trigger", arguments->trigger,
                  "Trigger of the studio file: cable, or action for GigE Vision action commands, "
                  "which the cameras always obey")
      .type_name("cable|action")
      .check(cli::one_of({"cable", "action"}))
      .show_default();
  command.add_flag("--no-ptp", arguments->has_no_ptp,
                   "The clocks of the cameras find no PTP master");
  command
      .add_option("--clap", arguments->clap,
                  "Pulse, from the first after --empty-pulses and with a fraction, at which the "
                  "performer stops as at a clap and stands still; --loop-frames is ignored")
      .check(cli::number_in(1, 10'000));
  command.add_option("--faults", arguments->faults,
                     "TOML file of faults: [[fault]] camera, pulse (from the first "
                     "after --empty-pulses), kind = drop|missed|duplicate|delay|freeze|unplug|"
                     "clock|black; see v3d-sim(1)");
  command.footer(
      "Prints \"ready\" when the cameras answer and the cable listens; serves until SIGTERM.\n"
      "The cameras' addresses (127.0.0.11 and up) must be on an interface; in a network of its "
      "own:\n"
      "  unshare -Urn sh -c '\n"
      "    ip link set lo up mtu 65536\n"
      "    ip route add 224.0.0.0/4 dev lo\n"
      "    for i in $(seq 11 25); do ip addr add 127.0.0.$i/32 dev lo; done\n"
      "    v3d-sim studio /tmp/studio --empty-pulses 16'");
  command.on_parsed([arguments, &status] { status = run(*arguments); });
}

}  // namespace v3d::sim
