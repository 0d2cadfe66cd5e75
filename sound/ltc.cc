#include "sound/ltc.h"

#include <ltc.h>

#include <algorithm>
#include <cmath>
#include <new>

#include "base/core/error.h"

namespace v3d::sound {
namespace {

using Decoder = std::unique_ptr<LTCDecoder, int (*)(LTCDecoder*)>;
using Encoder = std::unique_ptr<LTCEncoder, void (*)(LTCEncoder*)>;

/// Frames that libltc keeps for us; a second at 4 times the speed.
constexpr int kQueueFrames = 120;
/// libltc reads 8 bits: quiet channels are amplified first.
constexpr float kTargetPeak = 0.7F;
constexpr float kMinPeak = 1e-3F;
/// Decay of the measured peak in each block of kGainBlock samples.
constexpr float kPeakDecay = 0.9F;
constexpr size_t kGainBlock = 512;
constexpr int kFrameBytes = 10;
constexpr double kMaxStretch = 2;

LTC_TV_STANDARD standard_of(TimecodeRate rate) {
  if (rate == TimecodeRate::k24) return LTC_TV_FILM_24;
  return rate == TimecodeRate::k25 ? LTC_TV_625_50 : LTC_TV_525_60;
}

LtcFrame frame_of(LTCFrameExt& read) {
  const LTCFrame& bits = read.ltc;
  LtcFrame frame;
  frame.timecode = {.hours = static_cast<int>(bits.hours_tens * 10 + bits.hours_units),
                    .minutes = static_cast<int>(bits.mins_tens * 10 + bits.mins_units),
                    .seconds = static_cast<int>(bits.secs_tens * 10 + bits.secs_units),
                    .frames = static_cast<int>(bits.frame_tens * 10 + bits.frame_units)};
  frame.is_drop = bits.dfbit != 0;
  frame.is_reverse = read.reverse != 0;
  frame.sample = read.off_start;
  frame.samples = read.off_end - read.off_start + 1;
  return frame;
}

}  // namespace

struct LtcReader::Impl {
  Decoder decoder{nullptr, ltc_decoder_free};
  int64_t position = 0;
  float peak = kMinPeak;
  LtcFrame last;  ///< as read, also when it was not returned

  /// True when the frame begins where the one before it ended, and has about its length.
  bool continues(const LtcFrame& frame) const {
    const int64_t gap = std::abs(frame.sample - last.sample - last.samples);
    return gap <= last.samples / 8 && std::abs(frame.samples - last.samples) <= last.samples / 4;
  }
};

LtcReader::LtcReader(int rate_hz) : impl_(std::make_unique<Impl>()) {
  impl_->decoder.reset(ltc_decoder_create(rate_hz / 25, kQueueFrames));
  if (!impl_->decoder) throw std::bad_alloc();
}

LtcReader::~LtcReader() = default;

std::vector<LtcFrame> LtcReader::push(std::span<const float> samples) {
  std::vector<LtcFrame> frames;
  LTCDecoder* const decoder = impl_->decoder.get();
  for (size_t at = 0; at < samples.size(); at += kGainBlock) {
    const auto block = samples.subspan(at, std::min(kGainBlock, samples.size() - at));
    float peak = impl_->peak * kPeakDecay;
    for (const float value : block) peak = std::max(peak, std::abs(value));
    impl_->peak = std::max(kMinPeak, peak);
    std::vector<float> scaled(block.begin(), block.end());
    for (float& value : scaled) value *= kTargetPeak / impl_->peak;
    ltc_decoder_write_float(decoder, scaled.data(), scaled.size(), impl_->position);
    impl_->position += std::ssize(block);
    LTCFrameExt read;
    while (ltc_decoder_read(decoder, &read) > 0) {
      const LtcFrame frame = frame_of(read);
      if (impl_->continues(frame)) frames.push_back(frame);
      impl_->last = frame;
    }
  }
  return frames;
}

struct LtcWriter::Impl {
  Encoder encoder{nullptr, ltc_encoder_free};
  TimecodeRate rate;
  int64_t number = 0;
};

LtcWriter::LtcWriter(double rate_hz, TimecodeRate rate, const Timecode& start)
    : impl_(std::make_unique<Impl>()) {
  impl_->rate = rate;
  impl_->number = frame_number(start, rate);
  impl_->encoder.reset(
      ltc_encoder_create(rate_hz, frames_per_second(rate), standard_of(rate), LTC_BGF_DONT_TOUCH));
  if (!impl_->encoder) throw std::bad_alloc();
  const double longest = frames_per_second(rate) / (kMaxStretch + 0.5);
  if (ltc_encoder_set_buffersize(impl_->encoder.get(), rate_hz, longest) != 0) {
    throw std::bad_alloc();
  }
}

LtcWriter::~LtcWriter() = default;

std::vector<float> LtcWriter::next(double stretch) {
  const Timecode t = timecode_of(impl_->number++, impl_->rate);
  LTCEncoder* const encoder = impl_->encoder.get();
  LTCFrame bits;
  ltc_frame_reset(&bits);
  bits.hours_tens = static_cast<unsigned>(t.hours / 10) & 3U;
  bits.hours_units = static_cast<unsigned>(t.hours % 10) & 15U;
  bits.mins_tens = static_cast<unsigned>(t.minutes / 10) & 7U;
  bits.mins_units = static_cast<unsigned>(t.minutes % 10) & 15U;
  bits.secs_tens = static_cast<unsigned>(t.seconds / 10) & 7U;
  bits.secs_units = static_cast<unsigned>(t.seconds % 10) & 15U;
  bits.frame_tens = static_cast<unsigned>(t.frames / 10) & 3U;
  bits.frame_units = static_cast<unsigned>(t.frames % 10) & 15U;
  bits.dfbit = impl_->rate == TimecodeRate::k2997Drop ? 1 : 0;
  ltc_frame_set_parity(&bits, standard_of(impl_->rate));
  ltc_encoder_set_frame(encoder, &bits);
  for (int byte = 0; byte < kFrameBytes; ++byte) ltc_encoder_encode_byte(encoder, byte, stretch);
  ltcsnd_sample_t* bytes = nullptr;
  const int count = ltc_encoder_get_bufferptr(encoder, &bytes, 1);
  std::vector<float> samples(static_cast<size_t>(std::max(0, count)));
  std::transform(bytes, bytes + samples.size(), samples.begin(),
                 [](ltcsnd_sample_t byte) { return static_cast<float>(byte - 128) / 128; });
  return samples;
}

}  // namespace v3d::sound
