// Longitudinal timecode (LTC) in a sound channel: reader and writer. The adapter of libltc.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sound/timecode.h"

namespace v3d::sound {

/// Reads LTC, forwards or backwards, at 0.25 to 4 times its speed, at any level above -60 dB.
/// Source: SMPTE ST 12-1. One thread.
class LtcReader {
 public:
  explicit LtcReader(int rate_hz);
  ~LtcReader();
  LtcReader(const LtcReader&) = delete;
  LtcReader& operator=(const LtcReader&) = delete;

  /// Adds the next samples of the channel, full scale -1 to 1. Returns the frames that end in them,
  /// except the first ones of a signal: libltc still searches its speed then.
  /// The timecode of a damaged frame may not exist: see is_valid().
  std::vector<LtcFrame> push(std::span<const float> samples);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes LTC. One thread.
class LtcWriter {
 public:
  /// `rate_hz`: samples per second. Requires a valid `start`. Throws std::bad_alloc.
  LtcWriter(double rate_hz, TimecodeRate rate, const Timecode& start);
  ~LtcWriter();
  LtcWriter(const LtcWriter&) = delete;
  LtcWriter& operator=(const LtcWriter&) = delete;

  /// The samples of the next frame, at -3 dB of full scale. `stretch`: its length, of the nominal
  /// one; 0.5 to 2.
  std::vector<float> next(double stretch = 1);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::sound
