#include "daemon/captured/sound_health.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/core/text.h"
#include "daemon/node/advice.h"

namespace v3d::captured {
namespace {

/// Peaks above this share of full scale are reported as clipping.
constexpr double kClipping = 0.999;
constexpr double kMinDecibels = -150;

double decibels(double share) {
  return share > 0 ? std::max(kMinDecibels, 20 * std::log10(share)) : kMinDecibels;
}

}  // namespace

void report_sound(const NodeSound::Status& status, wire::HealthMessage& health,
                  bus::EventSender& events) {
  health.values["sound_open_flag"] = status.is_open ? 1 : 0;
  health.values["sound_samples"] = static_cast<double>(status.take.samples);
  health.values["sound_xruns"] = static_cast<double>(status.take.xruns);
  double loudest = 0;
  for (size_t i = 0; i < status.peaks.size(); ++i) {
    health.values["sound_peak_" + std::to_string(i + 1) + "_db"] = decibels(status.peaks[i]);
    loudest = std::max(loudest, status.peaks[i]);
  }
  const auto report = [&](const char* subject, const std::string& text, const char* advice) {
    events.report_condition(wire::Severity::kWarning, subject, text, advice);
  };
  report("sound", status.fault, node::advice::kSound);
  report("sound file", status.take.error, node::advice::kSoundFile);
  const int64_t xruns = status.take.xruns;
  report("sound xruns", xruns == 0 ? "" : format_count(xruns) + " xruns: samples of sound are lost",
         node::advice::kSoundXruns);
  const bool clips = loudest > kClipping;
  const bool is_silent = status.is_open && !status.peaks.empty() && loudest == 0;
  report("sound level",
         clips       ? "sound clips"
         : is_silent ? "sound is silent"
                     : "",
         node::advice::kSoundLevel);
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
