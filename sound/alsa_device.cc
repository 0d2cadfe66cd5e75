#include <alsa/asoundlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <optional>

#include "sound/sound_device.h"

namespace v3d::sound {
namespace {

constexpr unsigned kPeriodUs = 10'000;
constexpr unsigned kInputBufferUs = 500'000;
constexpr unsigned kOutputBufferUs = 200'000;
/// USB converters deliver samples once in a millisecond.
constexpr double kStampUncertainty = 1e-3;

using Pcm = std::unique_ptr<snd_pcm_t, int (*)(snd_pcm_t*)>;

/// How a format of samples becomes the upper bits of int32_t.
struct SampleFormat {
  snd_pcm_format_t format;
  size_t bytes;
};
constexpr std::array kFormats = {SampleFormat{SND_PCM_FORMAT_S32_LE, 4},
                                 SampleFormat{SND_PCM_FORMAT_S24_3LE, 3},
                                 SampleFormat{SND_PCM_FORMAT_S16_LE, 2}};

tl::unexpected<io::IoError> alsa_error(std::string_view action, const std::string& device,
                                       int error) {
  return io::io_error(action, device, snd_strerror(error), -error);
}

/// How a device is opened.
struct DeviceSetup {
  std::string name;
  snd_pcm_stream_t direction = SND_PCM_STREAM_CAPTURE;
  int channels = 2;
  int rate_hz = 48'000;
};

struct OpenDevice {
  Pcm pcm;
  SampleFormat format;
};

/// A little-endian sample in the upper bits.
int32_t value_of(const uint8_t* bytes, size_t count) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) value |= uint32_t{bytes[i]} << (8 * (4 - count + i));
  return static_cast<int32_t>(value);
}

class AlsaInput : public SoundInput {
 public:
  AlsaInput(Pcm pcm, const StudioSound& sound, size_t bytes)
      : pcm_(std::move(pcm)), sound_(sound), bytes_(bytes) {}

  io::Result<std::optional<SoundBlock>> read(Duration timeout) override {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count();
    const int ready = snd_pcm_wait(pcm_.get(), static_cast<int>(ms));
    if (ready == 0) return std::nullopt;
    if (ready < 0) return recover(ready);
    snd_pcm_status_t* status = nullptr;
    snd_pcm_status_alloca(&status);
    if (const int got = snd_pcm_status(pcm_.get(), status); got < 0) return recover(got);
    if (snd_pcm_status_get_state(status) == SND_PCM_STATE_XRUN) return recover(-EPIPE);
    return read_available(*status);
  }
  double stamp_uncertainty_s() const override { return kStampUncertainty; }

 private:
  io::Result<std::optional<SoundBlock>> read_available(const snd_pcm_status_t& status) {
    const auto available = static_cast<int64_t>(snd_pcm_status_get_avail(&status));
    const int64_t count = std::min<int64_t>(available, sound_.rate_hz / 20);
    if (count == 0) return std::nullopt;
    const size_t frame = bytes_ * static_cast<size_t>(sound_.channels);
    std::vector<uint8_t> raw(static_cast<size_t>(count) * frame);
    const snd_pcm_sframes_t got =
        snd_pcm_readi(pcm_.get(), raw.data(), static_cast<snd_pcm_uframes_t>(count));
    if (got < 0) return recover(static_cast<int>(got));
    SoundBlock block;
    block.position = delivered_;
    block.xruns = xruns_;
    for (size_t at = 0; at < static_cast<size_t>(got) * frame; at += bytes_) {
      block.values.push_back(value_of(raw.data() + at, bytes_));
    }
    delivered_ += got;
    snd_htimestamp_t stamp{};
    snd_pcm_status_get_htstamp(&status, &stamp);
    const auto later = static_cast<double>(available - got) / sound_.rate_hz;
    block.at =
        from_ns<Monotonic>(stamp.tv_sec * 1'000'000'000LL + stamp.tv_nsec) - from_seconds(later);
    return block;
  }

  /// After an xrun the device starts again; every other error ends it.
  io::Result<std::optional<SoundBlock>> recover(int error) {
    if (error != -EPIPE) return alsa_error("read", sound_.device, error);
    ++xruns_;
    int done = snd_pcm_prepare(pcm_.get());
    if (done >= 0) done = snd_pcm_start(pcm_.get());
    if (done < 0) return alsa_error("read", sound_.device, done);
    return std::nullopt;
  }

  Pcm pcm_;
  const StudioSound sound_;
  const size_t bytes_;  ///< of a value
  int64_t delivered_ = 0;
  int64_t xruns_ = 0;
};

/// Plays one signal on all channels.
class AlsaOutput : public SoundOutput {
 public:
  AlsaOutput(OpenDevice device, const StudioTimecodeOutput& output)
      : pcm_(std::move(device.pcm)), output_(output), bytes_(device.format.bytes) {}

  io::Result<PlayedSamples> wait(Duration timeout) override {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count();
    if (const int ready = snd_pcm_wait(pcm_.get(), static_cast<int>(ms)); ready < 0) {
      if (auto done = recover(ready); !done) return tl::make_unexpected(done.error());
    }
    snd_pcm_sframes_t space = 0, delay = 0;
    if (const int got = snd_pcm_avail_delay(pcm_.get(), &space, &delay); got < 0) {
      if (auto done = recover(got); !done) return tl::make_unexpected(done.error());
      space = delay = 0;
    }
    PlayedSamples played{.at = Monotonic::now(), .space = space, .underruns = underruns_};
    played.played = written_ - delay;
    if (takes_at_once_) pace(played);
    return played;
  }

  io::Status write(std::span<const float> samples) override {
    std::vector<uint8_t> raw;
    for (const float sample : samples) append(sample, raw);
    const auto count = static_cast<snd_pcm_uframes_t>(samples.size());
    const snd_pcm_sframes_t done = snd_pcm_writei(pcm_.get(), raw.data(), count);
    const int64_t before = written_;
    written_ += std::ssize(samples);  // also those that an underrun loses
    if (done < 0) return recover(static_cast<int>(done));
    if (!start_) {
      start_ = Monotonic::now() - from_seconds(static_cast<double>(before) / output_.rate_hz);
    }
    if (before == 0) {
      snd_pcm_sframes_t delay = 0;
      takes_at_once_ = snd_pcm_delay(pcm_.get(), &delay) == 0 && delay == 0;
    }
    return {};
  }

 private:
  void append(float sample, std::vector<uint8_t>& raw) const {
    const auto value = static_cast<uint32_t>(
        static_cast<int32_t>(std::lround(std::clamp(sample, -1.0F, 1.0F) * 8'388'607.0F)) * 256);
    for (int channel = 0; channel < output_.channels; ++channel) {
      for (size_t byte = 4 - bytes_; byte < 4; ++byte) {
        raw.push_back(static_cast<uint8_t>(value >> (8 * byte)));
      }
    }
  }

  /// For a device that takes samples at once: as if it played them at its rate. After an underrun
  /// it starts again with the next samples.
  void pace(PlayedSamples& played) {
    const auto due =
        start_ ? static_cast<int64_t>(to_seconds(played.at - *start_) * output_.rate_hz) : written_;
    if (due > written_) {
      played.underruns = ++underruns_;
      start_.reset();
    }
    played.played = std::min(written_, due);
    const int64_t buffer = int64_t{output_.rate_hz} * kOutputBufferUs / 1'000'000;
    played.space = std::min(played.space, buffer - (written_ - played.played));
  }

  /// After an underrun the device starts again with the next samples; every other error ends it.
  io::Status recover(int error) {
    if (error == -EPIPE) {
      ++underruns_;
      error = snd_pcm_prepare(pcm_.get());
    }
    if (error < 0) return alsa_error("play on", output_.device, error);
    return {};
  }

  Pcm pcm_;
  const StudioTimecodeOutput output_;
  const size_t bytes_;  ///< of a value
  int64_t written_ = 0;
  int64_t underruns_ = 0;
  bool takes_at_once_ = false;
  /// Of a device that takes samples at once: its start, later by the time of all underruns. Empty:
  /// it has nothing to play.
  std::optional<MonotonicInstant> start_;
};

/// For alsa-lib, which otherwise prints to standard error: results have the cause.
void ignore_message(const char* /*file*/, int /*line*/, const char* /*function*/, int /*error*/,
                    const char* /*format*/, ...) {}

/// Sets rate, channels and format. Returns the format.
io::Result<SampleFormat> configure(snd_pcm_t* pcm, const DeviceSetup& setup) {
  const bool plays = setup.direction == SND_PCM_STREAM_PLAYBACK;
  snd_pcm_hw_params_t* hardware = nullptr;
  snd_pcm_hw_params_alloca(&hardware);
  if (const int got = snd_pcm_hw_params_any(pcm, hardware); got < 0) {
    return alsa_error("open", setup.name, got);
  }
  const auto reject = [&](const std::string& why) {
    return io::io_error(
        "open", setup.name,
        why + (plays ? "; aplay" : "; arecord") + " --dump-hw-params lists what it has");
  };
  const std::string verb = plays ? "play" : "record";
  snd_pcm_hw_params_set_rate_resample(pcm, hardware, 0);
  snd_pcm_hw_params_set_access(pcm, hardware, SND_PCM_ACCESS_RW_INTERLEAVED);
  const auto* const format = std::ranges::find_if(kFormats, [&](const SampleFormat& f) {
    return snd_pcm_hw_params_set_format(pcm, hardware, f.format) == 0;
  });
  if (format == kFormats.end()) return reject("it has no format of 16, 24 or 32 bits");
  if (snd_pcm_hw_params_set_channels(pcm, hardware, static_cast<unsigned>(setup.channels)) != 0) {
    return reject("it does not " + verb + " " + std::to_string(setup.channels) + " channels");
  }
  if (snd_pcm_hw_params_set_rate(pcm, hardware, static_cast<unsigned>(setup.rate_hz), 0) != 0) {
    return reject("it does not " + verb + " at " + std::to_string(setup.rate_hz) + " Hz");
  }
  unsigned period = kPeriodUs, buffer = plays ? kOutputBufferUs : kInputBufferUs;
  snd_pcm_hw_params_set_period_time_near(pcm, hardware, &period, nullptr);
  snd_pcm_hw_params_set_buffer_time_near(pcm, hardware, &buffer, nullptr);
  if (const int got = snd_pcm_hw_params(pcm, hardware); got < 0) {
    return alsa_error("open", setup.name, got);
  }
  snd_pcm_sw_params_t* software = nullptr;
  snd_pcm_sw_params_alloca(&software);
  snd_pcm_sw_params_current(pcm, software);
  snd_pcm_sw_params_set_tstamp_mode(pcm, software, SND_PCM_TSTAMP_ENABLE);
  snd_pcm_sw_params_set_tstamp_type(pcm, software, SND_PCM_TSTAMP_TYPE_MONOTONIC);
  snd_pcm_sw_params(pcm, software);
  return *format;
}

io::Result<OpenDevice> open_device(const DeviceSetup& setup) {
  snd_lib_error_set_handler(ignore_message);
  snd_pcm_t* opened = nullptr;
  const int got = snd_pcm_open(&opened, setup.name.c_str(), setup.direction, SND_PCM_NONBLOCK);
  if (got < 0) return alsa_error("open", setup.name, got);
  Pcm pcm(opened, snd_pcm_close);
  const auto format = configure(pcm.get(), setup);
  if (!format) return tl::make_unexpected(format.error());
  return OpenDevice{std::move(pcm), *format};
}

}  // namespace

io::Result<std::unique_ptr<SoundInput>> open_alsa_input(const StudioSound& sound) {
  auto device =
      open_device({.name = sound.device, .channels = sound.channels, .rate_hz = sound.rate_hz});
  if (!device) return tl::make_unexpected(device.error());
  if (const int started = snd_pcm_start(device->pcm.get()); started < 0) {
    return alsa_error("start", sound.device, started);
  }
  return std::make_unique<AlsaInput>(std::move(device->pcm), sound, device->format.bytes);
}

io::Result<std::unique_ptr<SoundOutput>> open_sound_output(const StudioTimecodeOutput& output) {
  auto device = open_device({.name = output.device,
                             .direction = SND_PCM_STREAM_PLAYBACK,
                             .channels = output.channels,
                             .rate_hz = output.rate_hz});
  if (!device) return tl::make_unexpected(device.error());
  return std::make_unique<AlsaOutput>(*std::move(device), output);
}

}  // namespace v3d::sound
