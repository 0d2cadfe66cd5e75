#include "daemon/captured/sound_health.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "base/core/text.h"
#include "daemon/node/advice.h"

namespace v3d::captured {
namespace {

using sound::LevelFault;
using sound::LevelMonitor;

/// A subject for each channel, because the limit on repeated events compares the text of one.
void report_levels(const NodeSound::Status& status, wire::HealthMessage& health,
                   bus::EventSender& events) {
  const auto count = [&](LevelFault fault) {
    return static_cast<double>(
        std::ranges::count(status.level_faults, fault, &sound::ChannelFault::fault));
  };
  health.values["sound_channels_clipping"] = count(LevelFault::kClips);
  health.values["sound_channels_silent"] = count(LevelFault::kSilent);
  for (size_t channel = 1; channel <= status.peaks.size(); ++channel) {
    const auto found = std::ranges::find(status.level_faults, static_cast<int>(channel),
                                         &sound::ChannelFault::channel);
    const bool clips = found != status.level_faults.end() && found->fault == LevelFault::kClips;
    const std::string text =
        found == status.level_faults.end() ? ""
        : clips ? fmt::format("clips, with peaks of {:g} dBFS or more", LevelMonitor::kClippingDbfs)
                : fmt::format("is silent: no peak of {:g} dBFS for {:g} s",
                              LevelMonitor::kSilenceDbfs, LevelMonitor::kHoldSeconds);
    events.report_condition(wire::Severity::kWarning, "sound channel " + std::to_string(channel),
                            text, clips ? node::advice::kSoundClips : node::advice::kSoundSilent);
  }
}

void report_jumps(const SoundTake::Counts& take, wire::HealthMessage& health,
                  bus::EventSender& events) {
  health.values["sound_timecode_jumps"] = static_cast<double>(take.timecode_jumps);
  const std::string text =
      take.timecode_jumps == 0
          ? ""
          : format_count(take.timecode_jumps) +
                (take.timecode_jumps == 1 ? " jump of the timecode: "
                                          : " jumps of the timecode, the first: ") +
                take.first_jump;
  events.report_condition(wire::Severity::kWarning, "sound timecode", text,
                          node::advice::kTimecodeJumps);
}

}  // namespace

void report_sound(const NodeSound::Status& status, wire::HealthMessage& health,
                  bus::EventSender& events) {
  health.values["sound_open_flag"] = status.is_open ? 1 : 0;
  health.values["sound_samples"] = static_cast<double>(status.take.samples);
  health.values["sound_xruns"] = static_cast<double>(status.take.xruns);
  for (size_t i = 0; i < status.peaks.size(); ++i) {
    health.values["sound_peak_" + std::to_string(i + 1) + "_db"] =
        sound::decibels_of(status.peaks[i]);
  }
  const auto report = [&](const char* subject, const std::string& text, const char* advice) {
    events.report_condition(wire::Severity::kWarning, subject, text, advice);
  };
  report("sound", status.fault, node::advice::kSound);
  report("sound file", status.take.error, node::advice::kSoundFile);
  const int64_t xruns = status.take.xruns;
  report("sound xruns", xruns == 0 ? "" : format_count(xruns) + " xruns: samples of sound are lost",
         node::advice::kSoundXruns);
  report_jumps(status.take, health, events);
  report_levels(status, health, events);
}

void report_timecode_output(const TimecodeOutput::Status& status, wire::HealthMessage& health,
                            bus::EventSender& events) {
  health.values["timecode_output_open_flag"] = status.is_open ? 1 : 0;
  health.values["timecode_output_underruns"] = static_cast<double>(status.underruns);
  const auto report = [&](const char* subject, const std::string& text, const char* advice) {
    events.report_condition(wire::Severity::kWarning, subject, text, advice);
  };
  report("timecode output", status.fault, node::advice::kTimecodeOutput);
  report("timecode output underruns",
         status.underruns == 0
             ? ""
             : format_count(status.underruns) + " underruns: the timecode was interrupted",
         node::advice::kTimecodeUnderruns);
}

}  // namespace v3d::captured
