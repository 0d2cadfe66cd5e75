// Fuzz target: compact frames with the colours of cameras, a key frame and one that references it.
// Each is rejected or gives a valid mesh. The target corrects the checksums, as an attacker would.
#include <cstring>
#include <vector>

#include "codec/byte_stream.h"
#include "codec/frame_codec.h"
#include "fuzz_input.h"

namespace {

constexpr size_t kChecksum = 12, kChecked = 16, kKeyPulse = 40, kReference = 48;

template <class T>
void put(std::vector<uint8_t>& frame, size_t at, T number) {
  if (frame.size() >= at + sizeof(T)) std::memcpy(&frame[at], &number, sizeof(T));
}

uint32_t set_checksum(std::vector<uint8_t>& frame) {
  if (frame.size() < kChecked) return 0;
  const uint32_t sum = v3d::codec::crc32(std::span(frame).subspan(kChecked));
  put(frame, kChecksum, sum);
  return sum;
}

void check(const v3d::codec::DecodedFrame& frame) {
  for (const auto& triangle : frame.triangles) {
    for (const uint32_t vertex : triangle) v3d::test::must(vertex < frame.positions.size());
  }
  v3d::test::must(frame.labels.empty() || frame.labels.size() == frame.positions.size());
  v3d::test::must(frame.colours.empty() || frame.colours.size() == frame.positions.size());
  v3d::test::must(frame.cameras.empty() || frame.cameras.size() == frame.metadata.cameras.size());
  for (const auto& camera : frame.cameras) {
    v3d::test::must(camera.vertices.size() == frame.positions.size());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  const auto bytes = input.bytes(input.number<uint16_t>());
  const auto rest = input.bytes(size);
  std::vector<uint8_t> first(bytes.begin(), bytes.end()), second(rest.begin(), rest.end());
  v3d::codec::FrameDecoder decoder;
  decoder.enable_cameras(true);
  const uint32_t checksum = set_checksum(first);
  const bool has_first = decoder.decode(first) == v3d::codec::DecodeStatus::kOk;
  if (has_first) {
    check(decoder.frame());
    put(second, kKeyPulse, decoder.frame().key_pulse);
    put(second, kReference, checksum);
  }
  set_checksum(second);
  if (decoder.decode(second) == v3d::codec::DecodeStatus::kOk) check(decoder.frame());
  return 0;
}
