// Sound devices that play.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"

namespace v3d::sound {

/// Playback position of a device.
struct PlayedSamples {
  int64_t played = 0;     ///< of those that were written
  MonotonicInstant at{};  ///< time of `played`, clock of this host
  int64_t space = 0;      ///< samples that write() accepts now
  int64_t underruns = 0;  ///< until now: the device had nothing to play
};

/// An open device that plays. One thread.
class SoundOutput {
 public:
  virtual ~SoundOutput() = default;

  /// Waits until the device accepts samples, `timeout` at most. After an error the device must be
  /// opened again.
  [[nodiscard]] virtual io::Result<PlayedSamples> wait(Duration timeout) = 0;
  /// Plays samples on all channels, of full scale. Requires at most PlayedSamples::space.
  [[nodiscard]] virtual io::Status write(std::span<const float> samples) = 0;
};

/// Opens an ALSA device by its name ("hw:CARD=USB", as `aplay -L` lists them). The device itself
/// must have the rate and the channels: nothing is resampled. A device that takes samples at once,
/// as ALSA's `null` and `file`, plays them by the clock of the host. Fails with the device's name,
/// the cause, and what would be right.
[[nodiscard]] io::Result<std::unique_ptr<SoundOutput>> open_sound_output(
    const StudioTimecodeOutput& output);

}  // namespace v3d::sound
