// Sound devices: inputs (ALSA, and a simulated one) and outputs.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "sound/wave_file.h"

namespace v3d::sound {

/// Consecutive samples of a device.
struct SoundBlock {
  int64_t position = 0;   ///< number of samples that the device had delivered before
  int64_t xruns = 0;      ///< xruns until now: samples are lost before a block with a new one
  MonotonicInstant at{};  ///< when the last sample was recorded
  std::vector<int32_t> values{};  ///< interleaved (sound/wave_file.h)
};

/// An open device that records. One thread.
class SoundInput {
 public:
  virtual ~SoundInput() = default;

  /// The next block; empty when none came within `timeout`. After an error the device must be
  /// opened again.
  [[nodiscard]] virtual io::Result<std::optional<SoundBlock>> read(Duration timeout) = 0;
  /// Uncertainty of SoundBlock::at that does not show in its jitter, s.
  virtual double stamp_uncertainty_s() const = 0;
};

/// The pulses of the simulated trigger: returns those since the last call, without waiting.
using TriggerPulseSource = std::function<std::vector<MonotonicInstant>()>;

/// Opens the device of `sound`. `pulses`: for a simulated device; may be empty. Fails with the
/// device's name, the cause, and what would be right.
[[nodiscard]] io::Result<std::unique_ptr<SoundInput>> open_sound_input(const StudioSound& sound,
                                                                       TriggerPulseSource pulses);

/// Opens an ALSA device by its name ("hw:CARD=USB", as `arecord -L` lists them). The device
/// itself must have the rate and the channels: nothing is resampled. Stamps are those of the
/// driver, on CLOCK_MONOTONIC.
[[nodiscard]] io::Result<std::unique_ptr<SoundInput>> open_alsa_input(const StudioSound& sound);

/// Options of a simulated device: "simulated:ppm=80,xrun_s=3".
struct SimulatedSound {
  double ppm = 0;              ///< its clock is fast by this, 1e-6
  double xrun_s = 0;           ///< 0.1 s are lost once in this time; 0: never
  double clap_edge = 0;        ///< a clap sounds after this pulse, from 1 for the first; 0: none
  double clap_ms = 0;          ///< after its leading edge
  double timecode_jump_s = 0;  ///< the timecode jumps to 20:00:00:00 after this time; 0: never
  double stall_s = 0;          ///< it delivers nothing, and no error, after this time; 0: never
};
/// Empty when `device` names no simulated device, or has another option.
std::optional<SimulatedSound> parse_simulated_sound(const std::string& device);

/// A device in the time of this host. Its first channel has a tone of 440 Hz at -20 dB, the pulse
/// channel the pulses of `pulses`, the timecode channel LTC of 25 frames per second, from
/// 10:00:00:00 on. A clap is in the first channel.
std::unique_ptr<SoundInput> make_simulated_input(const StudioSound& sound,
                                                 const SimulatedSound& options,
                                                 TriggerPulseSource pulses);

/// The height of a pulse of `width` samples at `t` samples after its leading edge, 0 to 1. Its
/// edges are Gaussian with a standard deviation of one sample, which a converter can represent.
double pulse_value(double t, double width);

// Sound devices that play.

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
