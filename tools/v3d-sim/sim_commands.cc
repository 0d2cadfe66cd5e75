#include "v3d-sim/sim_commands.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/image/image.h"
#include "base/io/file.h"
#include "common/option_checks.h"
#include "sim/cameras/gige_cameras.h"
#include "sim/rendering/scene.h"

namespace v3d::sim {

constexpr int kMaxCameras = 200;

void add_studio_options(cli::Command command, StudioOptions& options) {
  const cli::Option cameras = command.add_option("--cameras", options.cameras, "Number of cameras")
                                  .check(cli::integer_in(1, kMaxCameras))
                                  .show_default();
  const cli::Option size =
      command.add_option("--size", options.size, "Image size in pixels, WIDTHxHEIGHT")
          .show_default();
  command
      .add_option("--rig", options.rig,
                  "The cameras of this calibration file, in place of those of --cameras and --size")
      .type_name("FILE")
      .excludes(cameras)
      .excludes(size);
  command.add_option("--seed", options.seed, "Random seed; equal seeds give equal bytes")
      .show_default();
  command.add_option("--rate", options.rate_hz, "Pulses per second")
      .check(pulse_rate())
      .show_default();
}

namespace {

/// Throws InputError for a rig that the simulator cannot render.
Rig load_rig(const std::string& path) {
  const Rig rig = load_calib(path);
  if (rig.empty() || std::ssize(rig) > kMaxCameras) {
    throw InputError(
        fmt::format("{}: has {} cameras, expected 1 to {}", path, rig.size(), kMaxCameras));
  }
  for (const RigCamera& camera : rig) {
    const ImageSize size = camera.model.size();
    if (size.width % 2 != 0 || size.height % 2 != 0) {
      throw InputError(fmt::format("{}: camera {} has images of {}x{}, expected even numbers", path,
                                   camera.name, size.width, size.height));
    }
  }
  return rig;
}

}  // namespace

Rig rig_of(const StudioOptions& options) {
  if (!options.rig.empty()) return load_rig(options.rig);
  return make_rig(options.cameras, parse_size(options.size, Sides::kEven), options.seed);
}

namespace {

constexpr std::string_view kStudioHead = "# A simulated studio, written by v3d-sim.\n";

}  // namespace

void require_own_studio(const std::filesystem::path& folder) {
  const auto studio = folder / "studio.toml";
  const auto calib = folder / "calib.toml";
  const bool has_studio = std::filesystem::exists(studio);
  if (!has_studio && !std::filesystem::exists(calib)) return;
  if (has_studio && read_file(studio).starts_with(kStudioHead)) return;
  throw InputError(folder.string() + ": has a " + (has_studio ? "studio.toml" : "calib.toml") +
                   " that v3d-sim did not write and would replace; name another folder");
}

void require_memory(const Rig& rig, int64_t images, int64_t available,
                    const std::string& rig_file) {
  constexpr double kRendererBytes = 12;  // of a pixel: plate, samples and two depth buffers
  double pixels = 0;
  for (const RigCamera& camera : rig) pixels += static_cast<double>(camera.model.size().pixels());
  const double needed = pixels * (static_cast<double>(images) + kRendererBytes);
  if (needed <= 0.8 * static_cast<double>(available)) return;
  throw InputError(fmt::format(
      "--loop-frames: {} images of each of {} cameras need {}, but {} are free; reduce {}",
      format_count(images), rig.size(), format_bytes(needed),
      format_bytes(static_cast<double>(available)),
      rig_file.empty() ? "--loop-frames, --cameras or --size"
                       : "--loop-frames or the cameras of --rig " + rig_file));
}

std::string studio_text(const Rig& rig, const StudioText& options) {
  std::string text = std::string(kStudioHead) +
                     "name = \"simulated\"\n\n"
                     "[[node]]\nname = \"cap01\"\n\n"
                     "[[node]]\nname = \"recon01\"\n\n"
                     "[camera_defaults]\n"
                     "node = \"cap01\"\n"
                     "kind = \"aravis\"\n"
                     "pixel_format = \"" +
                     options.pixel_format +
                     "\"\n"
                     "exposure_us = 1000.0\n"
                     "trigger_line = \"Line1\"\n"
                     "packet_size = 60000\n"
                     "buffers = 16\n\n";
  TomlWriter cameras;
  for (size_t i = 0; i < rig.size(); ++i) {
    const auto index = static_cast<int>(i);
    cameras.element("camera").text("name", rig[i].name);
    cameras.text("address", gige_address(index), gige_serial(index));
  }
  text += cameras.written();
  const bool acts = options.has_action_trigger;
  text +=
      std::string("\n[trigger]\nnode = \"cap01\"\nkind = \"") + (acts ? "action" : "simulated") +
      "\"\nrate_hz = " + toml_number(options.rate_hz) +
      "\npulse_width_us = " + toml_number(std::min(1000.0, 0.5e6 / options.rate_hz)) +
      (acts ? "\nbroadcast = \"127.255.255.255\"\nlead_ms = 100" : "\nwire = \"trigger.sock\"") +
      "\n\n"
      "[space]\nmin = [-1.5, -1.5, -0.05]\nmax = [1.5, 1.5, 2.45]\n\n"
      "[network]\nlcm_url = \"udpm://239.255.76.67:7667?ttl=0&recv_buf_size=16777216\"\nkey = "
      "\"studio.key\"\n\n"
      "[storage]\ntakes = \".\"\nbackground = \"background\"\ncalib = \"calib.toml\"\n\n"
      "[reconstruction]\nnode = \"recon01\"\nvoxel_m = " +
      toml_number(options.voxel_m) +
      "\nmin_views = " + std::to_string(std::min<size_t>(4, rig.size())) + "\n";
  return text;
}

}  // namespace v3d::sim
