// Ledger entry of a sound file: from the track of a recording, or afterwards from the file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sound/sound_track.h"
#include "take/ledger/sound_ledger.h"
#include "take/logs/log_files.h"
#include "take/take.h"

namespace v3d::take {

/// Copies the map of pulses, its edges and the LTC of a finished track into `sound`. `first_pulse`,
/// `last_pulse`: those whose timecode the ledger names, if the pulses have a map.
void describe_track(const sound::SoundTrack& track, int64_t first_pulse, int64_t last_pulse,
                    SoundLedger& sound);

/// Maps the pulses of a take to samples in sound files whose recording did not end.
///
/// The origin of a file and the log of pulses have wall-clock times, of one or two PCs. These give
/// each pulse a position, at first to milliseconds; the drift of the sample clock is unknown and
/// adds to the uncertainty. In the pulse channel, edges give exact positions. LTC is read as in a
/// recording; without it, the timecode is unknown. Silence for lost samples is not recognised.
///
/// Uses the studio file of the take. Files are read whole. The date of a file of an earlier version
/// (without sound::WaveOrigin::first_sample) is in the local time of the PC that recorded it; where
/// this process has another, no pulse is within the file. Returns a line for each file that gets no
/// map. `progress` is called for each block of a tenth of a second.
std::vector<std::string> map_recorded_sounds(const TakePaths& paths,
                                             std::vector<SoundLedger>& sounds,
                                             const ReadProgress& progress = {});

}  // namespace v3d::take
