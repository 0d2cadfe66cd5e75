#include "take/take_timecode.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "base/io/file.h"
#include "take/ledger/ledger.h"

namespace v3d::take {

sound::Timecode PulseTimecode::timecode() const {
  return sound::timecode_of(std::llround(std::floor(frames)), rate);
}

std::string PulseTimecode::text() const { return sound::timecode_text(timecode(), rate); }

TakeTimecode::TakeTimecode(const TakePaths& paths) {
  const auto type = io::value_or_throw(io::entry_type_of(paths.ledger()));
  if (type == std::filesystem::file_type::not_found) return;
  std::vector<SoundLedger> sounds = load_ledger(paths.ledger()).sounds;
  int rank = 0;
  for (SoundLedger& sound : sounds) {
    const auto rate = sound::timecode_rate_from_name(sound.timecode_rate);
    const bool is_known = rate && sound.map.is_known() && !sound.timecode_runs.empty();
    if (!is_known) continue;
    rank = std::max(rank, timecode_rank(sound));
    files_.push_back({.rate = *rate, .sound = std::move(sound)});
  }
  std::erase_if(files_, [&](const auto& file) { return timecode_rank(file.sound) < rank; });
}

std::optional<PulseTimecode> TakeTimecode::at(int64_t pulse) const {
  for (const auto& [rate, sound] : files_) {
    const double sample = sound.map.sample_of(static_cast<double>(pulse));
    if (const auto frames =
            sound::timecode_frames_at(sound.timecode_runs, rate, sound.rate_hz, sample)) {
      return PulseTimecode{.rate = rate, .frames = *frames};
    }
  }
  return std::nullopt;
}

}  // namespace v3d::take
