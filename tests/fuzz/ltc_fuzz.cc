// Fuzz target: a sound channel with timecode, in blocks of any length. The first byte chooses the
// rate; every other byte is a sample. Frames follow each other, and a timecode that is found
// exists.
#include <algorithm>
#include <optional>
#include <vector>

#include "fuzz_input.h"
#include "sound/ltc.h"
#include "sound/timecode.h"

namespace {

using v3d::sound::kTimecodeRates;
using v3d::test::must;

constexpr int kRateHz = 48'000;
constexpr size_t kBlock = 480;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  std::optional<v3d::sound::TimecodeRate> rate;
  if (data[0] % (kTimecodeRates.size() + 1) > 0) {
    rate = kTimecodeRates[data[0] % (kTimecodeRates.size() + 1) - 1];
  }
  v3d::sound::LtcReader reader(kRateHz);
  v3d::sound::TimecodeTrack track(kRateHz, rate);
  for (size_t at = 1; at < size; at += kBlock) {
    std::vector<float> block;
    for (size_t i = at; i < std::min(size, at + kBlock); ++i) {
      block.push_back(static_cast<float>(static_cast<int8_t>(data[i])) / 128);
    }
    for (const v3d::sound::LtcFrame& frame : reader.push(block)) {
      must(frame.samples > 0);
      track.add(frame);
    }
    const auto timecode = track.at(static_cast<double>(at));
    if (timecode) must(track.rate() && is_valid(*timecode, *track.rate()));
  }
  return 0;
}
