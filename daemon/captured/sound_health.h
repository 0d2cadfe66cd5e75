// Health and conditions of the sound devices of a capture node.
#pragma once

#include "daemon/bus/event_sender.h"
#include "daemon/captured/node_sound.h"
#include "daemon/captured/timecode_output.h"
#include "wire/messages.h"

namespace v3d::captured {

/// Adds sound_open_flag, sound_samples, sound_xruns, sound_peak_N_db, sound_channels_clipping and
/// sound_channels_silent and sound_timecode_jumps to the health. Reports faults of device and file,
/// lost samples, jumps of the timecode in the take, and each channel that clips or is silent as
/// conditions.
void report_sound(const NodeSound::Status& status, wire::HealthMessage& health,
                  bus::EventSender& events);

/// Adds timecode_output_open_flag and timecode_output_underruns to the health. Reports faults of
/// the device and underruns as conditions.
void report_timecode_output(const TimecodeOutput::Status& status, wire::HealthMessage& health,
                            bus::EventSender& events);

}  // namespace v3d::captured
