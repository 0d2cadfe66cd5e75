// TakeTimecode: the timecode of the pulses of a take.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sound/timecode.h"
#include "take/ledger/sound_ledger.h"
#include "take/take.h"

namespace v3d::take {

/// A timecode with its place within the frame.
struct PulseTimecode {
  sound::TimecodeRate rate = sound::TimecodeRate::k25;
  double frames = 0;  ///< since midnight, may exceed a day

  sound::Timecode timecode() const;
  std::string text() const;  ///< sound::timecode_text()
};

/// The timecode of each pulse, by the maps of pulses and the runs of timecode in the ledger. Only
/// sound files whose source of timecode has the highest rank in the take count. Thread-safe.
class TakeTimecode {
 public:
  /// Throws as load_ledger(). A take without a ledger, or without sound, has no timecode.
  explicit TakeTimecode(const TakePaths& paths);

  /// The timecode at the leading edge of a pulse; empty where it is unknown.
  std::optional<PulseTimecode> at(int64_t pulse) const;

 private:
  struct File {
    sound::TimecodeRate rate;
    SoundLedger sound;
  };
  std::vector<File> files_;
};

}  // namespace v3d::take
