// Fuzz target: assembly of decoded frames with arbitrary numbers into frame sets. At most the
// permitted number of sets waits, each set is released once and in order, and losses are counted.
#include "daemon/bus/subscription_queue.h"
#include "fuzz_input.h"
#include "recon/pipeline/frame_set.h"

namespace {

using v3d::test::must;

constexpr size_t kMaxMessages = 256;

/// Wraps around, because messages may hold any number.
int64_t near(int64_t pulse, int difference) {
  return static_cast<int64_t>(static_cast<uint64_t>(pulse) + static_cast<uint64_t>(difference));
}

class Reconstruction {
 public:
  void take(v3d::test::FuzzInput& input) {
    v3d::Frame frame;
    const auto byte = input.number<uint8_t>();
    frame.camera = "cam0" + std::to_string(byte % 4);  // cam03 is not expected
    // Numbers near the previous one reach more code than random ones.
    pulse_ = byte & 4 ? input.number<int64_t>() : near(pulse_, input.number<int8_t>() % 4);
    frame.label.pulse = pulse_;
    const int64_t seq = byte & 8 ? input.number<int64_t>() : pulse_;
    now_ += std::chrono::milliseconds(byte >> 4);
    sequences_.note(frame.camera, std::max<int64_t>(0, seq),
                    v3d::from_ns<v3d::Realtime>(input.number<int16_t>()));
    check_sets(assembler_.add(std::move(frame), now_));
  }
  void end() {
    check_sets(assembler_.flush());
    const v3d::bus::SequenceCounts& counts = sequences_.total();
    must(counts.received >= 0 && counts.lost >= 0 && counts.late <= counts.received);
  }

 private:
  void check_sets(const std::vector<v3d::recon::ReadySet>& ready) {
    for (const v3d::recon::ReadySet& set : ready) {
      must(set.set.pulse > newest_ && !set.set.frames.empty());
      must(set.set.frames.size() + set.missing.size() == 3);
      newest_ = set.set.pulse;
    }
  }

  v3d::recon::FrameSetAssembler assembler_{{.cameras = {"cam00", "cam01", "cam02"}, .max_open = 4}};
  v3d::bus::SequenceTracker sequences_{true};
  v3d::MonotonicInstant now_;
  int64_t pulse_ = 0;
  int64_t newest_ = -1;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  Reconstruction reconstruction;
  for (size_t i = 0; i < kMaxMessages && !input.empty(); ++i) reconstruction.take(input);
  reconstruction.end();
  return 0;
}
