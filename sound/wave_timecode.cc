#include "sound/wave_timecode.h"

#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <limits>

#include "base/core/error.h"

namespace v3d::sound {
namespace {

/// The rate as a fraction, and the flag of dropped numbers.
struct Speed {
  std::string_view rate, flag;
};

Speed speed_of(TimecodeRate rate) {
  switch (rate) {
    case TimecodeRate::k24:
      return {"24/1", "NDF"};
    case TimecodeRate::k25:
      return {"25/1", "NDF"};
    case TimecodeRate::k2997:
      return {"30000/1001", "NDF"};
    case TimecodeRate::k2997Drop:
      return {"30000/1001", "DF"};
    case TimecodeRate::k30:
      return {"30/1", "NDF"};
  }
  return {};
}

/// The content of the first element `name`; empty where there is none.
std::string_view element(std::string_view text, std::string_view name) {
  const std::string tag = fmt::format("<{}>", name);
  const size_t begin = text.find(tag);
  if (begin == std::string_view::npos) return {};
  text.remove_prefix(begin + tag.size());
  const size_t end = text.find('<');
  return end == std::string_view::npos ? std::string_view() : text.substr(0, end);
}

}  // namespace

std::string WaveTimecode::text(int rate_hz) const {
  const double frames =
      static_cast<double>(samples_since_midnight) / rate_hz * frames_per_second(rate);
  // The reference is rounded to a sample.
  const double half_sample = 0.5 * frames_per_second(rate) / rate_hz;
  return timecode_text(timecode_of(std::llround(std::floor(frames + half_sample)), rate), rate);
}

std::optional<WaveTimecode> first_timecode(std::span<const TimecodeRun> runs, TimecodeRate rate,
                                           int rate_hz) {
  constexpr double kAnyDistance = std::numeric_limits<double>::infinity();
  const auto frames = timecode_frames_at(runs, rate, rate_hz, 0, kAnyDistance);
  if (!frames) return std::nullopt;
  const auto day = static_cast<double>(frames_per_day(rate));
  const double today = *frames - day * std::floor(*frames / day);
  // The frames have half a sample in addition.
  return WaveTimecode{.rate = rate,
                      .samples_since_midnight =
                          std::llround(std::floor(today / frames_per_second(rate) * rate_hz))};
}

std::string write_metadata(const WaveMetadata& metadata) {
  std::string timecode;
  if (metadata.timecode_rate) {
    const Speed speed = speed_of(*metadata.timecode_rate);
    timecode = fmt::format(
        "<MASTER_SPEED>{0}</MASTER_SPEED>\n<CURRENT_SPEED>{0}</CURRENT_SPEED>\n"
        "<TIMECODE_RATE>{0}</TIMECODE_RATE>\n<TIMECODE_FLAG>{1}</TIMECODE_FLAG>\n",
        speed.rate, speed.flag);
  }
  const auto reference = static_cast<uint64_t>(metadata.samples_since_midnight);
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<BWFXML>\n<IXML_VERSION>1.61</IXML_VERSION>\n";
  // Before the elements whose length changes: a power cut may leave a part of the new text.
  if (metadata.first_sample) {
    text += fmt::format("<V3D><FIRST_SAMPLE_UTC_NS>{}</FIRST_SAMPLE_UTC_NS></V3D>\n",
                        to_ns(*metadata.first_sample));
  }
  text += fmt::format(
      "<SPEED>\n{}<FILE_SAMPLE_RATE>{}</FILE_SAMPLE_RATE>\n<AUDIO_BIT_DEPTH>24</AUDIO_BIT_DEPTH>\n"
      "<TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_HI>{}</TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_HI>\n"
      "<TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_LO>{}</TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_LO>\n"
      "<TIMESTAMP_SAMPLE_RATE>{}</TIMESTAMP_SAMPLE_RATE>\n</SPEED>\n",
      timecode, metadata.rate_hz, reference >> 32, reference & UINT32_MAX, metadata.rate_hz);
  text += "</BWFXML>\n";
  V3D_CHECK(text.size() <= kMetadataBytes);
  text.resize(kMetadataBytes, ' ');
  return text;
}

WaveMetadata read_metadata(std::string_view text) {
  WaveMetadata metadata;
  const std::string_view rate = element(text, "TIMECODE_RATE");
  const std::string_view flag = element(text, "TIMECODE_FLAG");
  for (const TimecodeRate known : kTimecodeRates) {
    const Speed speed = speed_of(known);
    if (speed.rate == rate && speed.flag == flag) metadata.timecode_rate = known;
  }
  const std::string_view first = element(text, "FIRST_SAMPLE_UTC_NS");
  int64_t ns = 0;
  const auto parsed = std::from_chars(first.data(), first.data() + first.size(), ns);
  const bool is_number = parsed.ec == std::errc() && parsed.ptr == first.data() + first.size();
  if (is_number && ns > 0) metadata.first_sample = from_ns<Realtime>(ns);
  return metadata;
}

}  // namespace v3d::sound
