// takes clap: finds a clap in a take, and the offset between sound and pictures.
#include "v3dctl/takes/clap.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "capture/segmentation/motion_stops.h"
#include "sound/level_monitor.h"
#include "take/logs/frame_log.h"
#include "take/take_sound.h"
#include "v3dctl/options.h"
#include "v3dctl/takes/named_takes.h"

namespace v3d::ctl {
namespace {

constexpr int kRateHz = 48'000;
constexpr int64_t kBlock = kRateHz;
/// Frames that are read before and after the sound: the motion is compared with half a second
/// around its stop, which is within half a second of the sound.
constexpr double kReadSeconds = 1;

/// The clap in the sound, in pulses.
std::optional<double> clap_in_sound(take::TakeSound& sound, const take::TakeInfo& info) {
  sound::ClapFinder finder(kRateHz);
  const double step = info.rate_hz / kRateHz;
  const auto samples = static_cast<int64_t>(static_cast<double>(info.pulses) / step);
  for (int64_t at = 0; at < samples; at += kBlock) {
    const auto stereo = sound.read(static_cast<double>(at) * step, step, kBlock);
    std::vector<float> mono;
    for (size_t i = 0; i < stereo.size(); i += 2) {
      mono.push_back((stereo[i] + stereo[i + 1]) / 2);
    }
    finder.push(mono);
  }
  if (!finder.clap()) return std::nullopt;
  return finder.clap()->sample * step;
}

/// The stop of a motion in the frames of one camera, near a pulse.
std::optional<segmentation::MotionStop> stop_in_frames(const std::filesystem::path& log,
                                                       double pulse, double rate_hz) {
  take::FrameLogReader frames(log);
  const auto first = static_cast<int64_t>(std::floor(pulse - kReadSeconds * rate_hz));
  const auto last = static_cast<int64_t>(std::ceil(pulse + kReadSeconds * rate_hz));
  segmentation::MotionSeries series;
  for (int64_t n = std::max<int64_t>(0, first); n <= last; ++n) {
    if (const auto frame = frames.read(n)) series.add(n, frame->image.view());
  }
  return stop_near(series.stops(rate_hz), pulse, rate_hz);
}

}  // namespace

std::optional<ClapOffset> find_take_clap(const take::TakePaths& paths) {
  const take::TakeInfo info = load_take_info(paths);
  take::TakeSound sound(paths);
  if (sound.is_silent()) {
    throw InputError(paths.folder.string() +
                     ": has no sound with a map of its pulses; expected a take of a studio with "
                     "[[sound]]");
  }
  const auto heard = clap_in_sound(sound, info);
  if (!heard) return std::nullopt;
  ClapOffset clap{
      .sound_pulse = *heard, .sound_uncertainty_s = sound.uncertainty_s(), .rate_hz = info.rate_hz};
  for (const std::string& camera : info.cameras) {
    const auto stop = stop_in_frames(paths.frames(camera), *heard, info.rate_hz);
    if (stop) clap.cameras.push_back({camera, stop->pulse});
  }
  return clap;
}

namespace {

using Json = nlohmann::ordered_json;

std::string text_of(const std::string& name, const std::optional<ClapOffset>& clap) {
  return "take " + name + ": " + (clap ? clap_text(*clap) : "no clap in its sound");
}

Json json_of(const std::string& name, const std::optional<ClapOffset>& clap) {
  Json json = {{"name", name}};
  json.update(clap_json(clap));
  return json;
}

int run_clap(const CommandLine& line, const TakesArguments& arguments) {
  Json claps = Json::array();
  bool all_found = true;
  for (const take::TakeListing& take : named_takes(line, arguments)) {
    const std::optional<ClapOffset> clap = find_take_clap(take.paths);
    all_found = all_found && clap && !clap->cameras.empty();
    claps.push_back(json_of(take.info.name, clap));
    if (!arguments.json) std::printf("%s\n", text_of(take.info.name, clap).c_str());
  }
  if (arguments.json) std::printf("%s\n", Json{{"claps", std::move(claps)}}.dump(2).c_str());
  return all_found ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_takes_clap(CommandLine& line, cli::Command takes, const SharedTakesArguments& shared) {
  cli::Command command = add_takes_subcommand(
      takes, "clap", "Report how much later a clap is in the sound of takes than in their pictures",
      "v3dctl takes clap kendo-07");
  add_names_option(command, shared);
  line.on_run(command, [&line, shared] { return run_clap(line, *shared); });
}

}  // namespace v3d::ctl
