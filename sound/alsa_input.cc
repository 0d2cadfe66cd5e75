#include <alsa/asoundlib.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "sound/sound_input.h"

namespace v3d::sound {
namespace {

constexpr unsigned kPeriodUs = 10'000;
constexpr unsigned kBufferUs = 500'000;
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

/// For alsa-lib, which otherwise prints to standard error: results have the cause.
void ignore_message(const char* /*file*/, int /*line*/, const char* /*function*/, int /*error*/,
                    const char* /*format*/, ...) {}

/// Sets rate, channels and format. Returns the bytes of a value.
io::Result<size_t> configure(snd_pcm_t* pcm, const StudioSound& sound) {
  snd_pcm_hw_params_t* hardware = nullptr;
  snd_pcm_hw_params_alloca(&hardware);
  if (const int got = snd_pcm_hw_params_any(pcm, hardware); got < 0) {
    return alsa_error("open", sound.device, got);
  }
  const auto reject = [&](const std::string& why) {
    return io::io_error("open", sound.device, why + "; arecord --dump-hw-params lists what it has");
  };
  snd_pcm_hw_params_set_rate_resample(pcm, hardware, 0);
  snd_pcm_hw_params_set_access(pcm, hardware, SND_PCM_ACCESS_RW_INTERLEAVED);
  const auto* const format = std::ranges::find_if(kFormats, [&](const SampleFormat& f) {
    return snd_pcm_hw_params_set_format(pcm, hardware, f.format) == 0;
  });
  if (format == kFormats.end()) return reject("it has no format of 16, 24 or 32 bits");
  if (snd_pcm_hw_params_set_channels(pcm, hardware, static_cast<unsigned>(sound.channels)) != 0) {
    return reject("it does not record " + std::to_string(sound.channels) + " channels");
  }
  if (snd_pcm_hw_params_set_rate(pcm, hardware, static_cast<unsigned>(sound.rate_hz), 0) != 0) {
    return reject("it does not record at " + std::to_string(sound.rate_hz) + " Hz");
  }
  unsigned period = kPeriodUs, buffer = kBufferUs;
  snd_pcm_hw_params_set_period_time_near(pcm, hardware, &period, nullptr);
  snd_pcm_hw_params_set_buffer_time_near(pcm, hardware, &buffer, nullptr);
  if (const int got = snd_pcm_hw_params(pcm, hardware); got < 0) {
    return alsa_error("open", sound.device, got);
  }
  snd_pcm_sw_params_t* software = nullptr;
  snd_pcm_sw_params_alloca(&software);
  snd_pcm_sw_params_current(pcm, software);
  snd_pcm_sw_params_set_tstamp_mode(pcm, software, SND_PCM_TSTAMP_ENABLE);
  snd_pcm_sw_params_set_tstamp_type(pcm, software, SND_PCM_TSTAMP_TYPE_MONOTONIC);
  snd_pcm_sw_params(pcm, software);
  return format->bytes;
}

}  // namespace

io::Result<std::unique_ptr<SoundInput>> open_alsa_input(const StudioSound& sound) {
  snd_lib_error_set_handler(ignore_message);
  snd_pcm_t* opened = nullptr;
  const int got =
      snd_pcm_open(&opened, sound.device.c_str(), SND_PCM_STREAM_CAPTURE, SND_PCM_NONBLOCK);
  if (got < 0) return alsa_error("open", sound.device, got);
  Pcm pcm(opened, snd_pcm_close);
  const auto bytes = configure(pcm.get(), sound);
  if (!bytes) return tl::make_unexpected(bytes.error());
  if (const int started = snd_pcm_start(pcm.get()); started < 0) {
    return alsa_error("start", sound.device, started);
  }
  return std::make_unique<AlsaInput>(std::move(pcm), sound, *bytes);
}

}  // namespace v3d::sound
