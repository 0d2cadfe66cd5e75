#include "take/ledger/sound_ledger.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "base/core/text.h"
#include "sound/wave_file.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

constexpr int64_t kMaxSamples = int64_t{1} << 45;  // years

int64_t read_count(const TomlTable& table, std::string_view key) {
  const int64_t n = table.integer_or(key, 0);
  if (n < 0 || n > kMaxSamples) table.fail(key, "expected a count, 0 or more");
  return n;
}

/// Pairs of numbers.
std::vector<std::vector<double>> read_pairs(const TomlTable& table, std::string_view key) {
  if (!table.has(key)) return {};
  std::vector<std::vector<double>> rows = table.rows(key);
  for (const std::vector<double>& row : rows) {
    if (row.size() != 2) table.fail(key, "expected pairs of numbers");
  }
  return rows;
}

/// The first numbers ascend.
std::vector<std::vector<double>> read_gaps(const TomlTable& table) {
  std::vector<std::vector<double>> gaps = read_pairs(table, "gaps");
  for (size_t i = 1; i < gaps.size(); ++i) {
    if (!(gaps[i][0] > gaps[i - 1][0])) table.fail("gaps", "expected ascending pairs");
  }
  return gaps;
}

/// Earlier versions wrote some knots twice, with positions a few samples apart. The first is right.
sound::PulseMap read_map(const TomlTable& table) {
  sound::PulseMap map;
  for (const auto& row : read_pairs(table, "map")) {
    const sound::PulseMap::Knot knot{.pulse = row[0], .sample = row[1]};
    if (!map.knots.empty()) {
      const sound::PulseMap::Knot& last = map.knots.back();
      if (knot.pulse == last.pulse) continue;
      const bool ascends = knot.pulse > last.pulse && knot.sample > last.sample;
      if (!ascends) table.fail("map", "expected ascending pairs");
    }
    map.knots.push_back(knot);
  }
  return map;
}

std::vector<sound::TimecodeRun> read_runs(const TomlTable& table) {
  if (!table.has("timecode_runs")) return {};
  constexpr double kMaxFrames = 1e9;  // a year
  std::vector<sound::TimecodeRun> runs;
  for (const std::vector<double>& row : table.rows("timecode_runs")) {
    const bool is_run = row.size() == 4 && row[2] >= row[0] && std::abs(row[1]) <= kMaxFrames &&
                        std::abs(row[3]) <= kMaxFrames;
    if (!is_run) {
      table.fail("timecode_runs", "expected rows [sample, frame, later sample, frame]");
    }
    runs.push_back({.first_sample = row[0],
                    .first_frame = std::llround(row[1]),
                    .last_sample = row[2],
                    .last_frame = std::llround(row[3])});
  }
  return runs;
}

/// The node in a file name: "cap01" in "cap01.wav" and "cap01.0001.wav".
std::string node_of(const std::filesystem::path& file) {
  std::string name = file.stem();
  constexpr size_t kNumber = 5;  // ".0001"
  const size_t dot = name.size() < kNumber ? std::string::npos : name.size() - kNumber;
  const bool is_numbered =
      dot != std::string::npos && name[dot] == '.' &&
      std::all_of(name.begin() + static_cast<std::ptrdiff_t>(dot) + 1, name.end(),
                  [](unsigned char c) { return std::isdigit(c) != 0; });
  return is_numbered ? name.substr(0, dot) : name;
}

/// The map covers all pulses of the recording. The file does not where its device failed until the
/// end, or was opened late, or the file could not be written any more.
void add_missing_ends(const SoundLedger& sound, std::vector<std::string>& parts) {
  if (!sound.map.is_known() || sound.rate_hz == 0) return;
  constexpr double kMinSeconds = 1, kMaxSeconds = 1e9;
  const auto add = [&](double samples, const std::string& verb, const std::string& pulse) {
    const double seconds = std::min(samples / sound.rate_hz, kMaxSeconds);
    if (!(seconds > kMinSeconds)) return;
    parts.push_back(verb + " " + format_count(std::llround(seconds)) + " s " + pulse);
  };
  add(-sound.map.knots.front().sample, "begins", "after the first pulse");
  add(sound.map.knots.back().sample - static_cast<double>(sound.samples), "ends",
      "before the last pulse");
}

}  // namespace

SoundLedger read_sound_ledger(const TomlTable& table) {
  SoundLedger sound;
  sound.file = table.text("file");
  sound.node = table.text("node");
  sound.rate_hz = static_cast<int>(std::min<int64_t>(read_count(table, "rate_hz"), INT32_MAX));
  sound.channels = static_cast<int>(std::min<int64_t>(read_count(table, "channels"), INT32_MAX));
  sound.samples = read_count(table, "samples");
  sound.xruns = read_count(table, "xruns");
  sound.lost_samples = read_count(table, "lost_samples");
  sound.gaps = read_gaps(table);
  sound.map_source = table.text_or("map_source", sound.map_source);
  sound.map = read_map(table);
  sound.uncertainty_us = table.number_or("uncertainty_us", 0);
  sound.drift_ppm = table.number_or("drift_ppm", 0);
  sound.missing_edges = read_count(table, "missing_edges");
  sound.extra_edges = read_count(table, "extra_edges");
  sound.timecode_source = table.text_or("timecode_source", sound.timecode_source);
  sound.timecode_rate = table.text_or("timecode_rate", "");
  sound.first_timecode = table.text_or("first_timecode", "");
  sound.last_timecode = table.text_or("last_timecode", "");
  sound.timecode_jumps = read_count(table, "timecode_jumps");
  sound.timecode_runs = read_runs(table);
  table.reject_unknown_fields();
  return sound;
}

void write_sound_ledger(const SoundLedger& sound, TomlWriter& file) {
  std::vector<std::vector<double>> map;
  for (const auto& knot : sound.map.knots) map.push_back({knot.pulse, knot.sample});
  std::vector<std::vector<double>> runs;
  for (const sound::TimecodeRun& run : sound.timecode_runs) {
    runs.push_back({run.first_sample, static_cast<double>(run.first_frame), run.last_sample,
                    static_cast<double>(run.last_frame)});
  }
  file.element("sound")
      .text("file", sound.file)
      .text("node", sound.node)
      .integer("rate_hz", sound.rate_hz)
      .integer("channels", sound.channels)
      .integer("samples", sound.samples)
      .integer("xruns", sound.xruns)
      .integer("lost_samples", sound.lost_samples)
      .rows("gaps", sound.gaps)
      .text("map_source", sound.map_source)
      .number("uncertainty_us", sound.uncertainty_us)
      .number("drift_ppm", sound.drift_ppm)
      .integer("missing_edges", sound.missing_edges)
      .integer("extra_edges", sound.extra_edges)
      .rows("map", map)
      .text("timecode_source", sound.timecode_source)
      .text("timecode_rate", sound.timecode_rate)
      .text("first_timecode", sound.first_timecode)
      .text("last_timecode", sound.last_timecode)
      .integer("timecode_jumps", sound.timecode_jumps)
      .rows("timecode_runs", runs);
}

std::string contents_of(const SoundLedger& sound) {
  return format_count(sound.samples) + " samples of " + format_count(sound.channels) +
         " channels at " + format_count(sound.rate_hz) + " Hz";
}

std::string problem_line(const SoundLedger& sound) {
  std::vector<std::string> parts;
  if (sound.xruns > 0) {
    parts.push_back(format_count(sound.xruns) + " xruns, " + format_count(sound.lost_samples) +
                    " samples lost");
  }
  add_missing_ends(sound, parts);
  if (sound.map_source == "none") parts.push_back("no pulse has a position in the sound");
  if (sound.missing_edges > 0) {
    parts.push_back(format_count(sound.missing_edges) + " pulses without an edge in the sound");
  }
  if (sound.timecode_jumps > 0) {
    parts.push_back(format_count(sound.timecode_jumps) + (sound.timecode_jumps == 1
                                                              ? " jump of the timecode"
                                                              : " jumps of the timecode"));
  }
  return parts.empty() ? "" : sound.file + ": " + join_names(parts);
}

int timecode_rank(const SoundLedger& sound) {
  return sound.timecode_source == "ltc" ? 2 : sound.timecode_source == "output" ? 1 : 0;
}

std::string timecode_text(const std::vector<SoundLedger>& sounds) {
  const SoundLedger *first = nullptr, *last = nullptr;
  for (const SoundLedger& sound : sounds) {
    if (sound.first_timecode.empty() || sound.last_timecode.empty()) continue;
    const int rank = timecode_rank(sound);
    if (first == nullptr || rank > timecode_rank(*first)) first = last = &sound;
    // A node that was restarted in the take has several files.
    if (rank == timecode_rank(*first) && sound.node == first->node) last = &sound;
  }
  return first == nullptr ? "" : first->first_timecode + " to " + last->last_timecode;
}

io::Result<ReadSounds> read_sounds(const TakePaths& paths) {
  ReadSounds read;
  const auto type = io::entry_type_of(paths.sound());
  if (!type) return tl::make_unexpected(type.error());
  if (*type == std::filesystem::file_type::not_found) return read;
  const auto files = io::list_folder(paths.sound());
  if (!files) return tl::make_unexpected(files.error());
  for (const std::filesystem::path& path : *files) {
    if (path.extension() != ".wav" || !is_utf8(path.filename().native())) continue;
    const auto wave = sound::WaveReader::open(path);
    if (!wave) {
      read.problems.push_back(wave.error().message);
      continue;
    }
    SoundLedger sound;
    sound.file = paths.sound().filename() / path.filename();
    sound.node = node_of(path);
    sound.rate_hz = wave->format().rate_hz;
    sound.channels = wave->format().channels;
    sound.samples = wave->samples();
    read.sounds.push_back(std::move(sound));
  }
  return read;
}

io::Result<std::filesystem::path> next_sound_file(const TakePaths& paths, const std::string& node) {
  const std::filesystem::path first = paths.sound() / (node + ".wav");
  return existing_segments(first).map(
      [&](const auto& files) { return next_segment(first, files); });
}

}  // namespace v3d::take
