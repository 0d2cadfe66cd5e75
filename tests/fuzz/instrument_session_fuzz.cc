// Fuzz target: a signal generator on USB with arbitrary replies. Arm, start and stop always end,
// with success or an InputError.
#include "base/core/error.h"
#include "fuzz_input.h"
#include "trigger/scpi/scpi_generator.h"
#include "trigger/scpi/usbtmc.h"

namespace {

using v3d::test::FuzzInput;

/// A USB port with replies from the fuzzer input. One byte for each call selects its outcome; most
/// succeed.
class HostilePort : public v3d::trigger::UsbPort {
 public:
  explicit HostilePort(FuzzInput& input) : input_(input) {}
  v3d::trigger::UsbOutcome send(std::span<const uint8_t> bytes, v3d::Duration) override {
    if (bytes.size() > 1) tag_ = bytes[1];
    return outcome();
  }
  v3d::trigger::UsbOutcome receive(std::vector<uint8_t>& bytes, v3d::Duration) override {
    const auto answer = input_.bytes(input_.number<uint8_t>() % 64);
    bytes.assign(answer.begin(), answer.end());
    // Copy the tag, because a random tag would almost never match the question.
    if (bytes.size() >= v3d::trigger::kUsbtmcHeader && bytes[0] == 2) {
      bytes[1] = tag_;
      bytes[2] = static_cast<uint8_t>(~tag_);
    }
    return outcome();
  }
  v3d::trigger::UsbOutcome request(v3d::trigger::UsbtmcRequest, uint16_t,
                                   uint8_t& status) override {
    status = input_.number<uint8_t>();
    return outcome();
  }
  void clear_stalls() override {}

 private:
  v3d::trigger::UsbOutcome outcome() {
    const auto byte = input_.number<uint8_t>();
    if (input_.empty()) return v3d::trigger::UsbOutcome::kGone;
    return byte > 4 ? v3d::trigger::UsbOutcome::kDone : static_cast<v3d::trigger::UsbOutcome>(byte);
  }
  FuzzInput& input_;
  uint8_t tag_ = 0;
};

v3d::StudioTrigger trigger_of(uint8_t dialect) {
  v3d::StudioTrigger trigger;
  trigger.kind = v3d::TriggerKind::kScpi;
  trigger.instrument = {.vendor = 0x0957, .product = 0x2c07};
  trigger.dialect = static_cast<v3d::Dialect>(dialect % 4);
  return trigger;
}

void run_generator(FuzzInput& input) {
  v3d::MonotonicInstant now;
  const v3d::HostClock clock{.now = [&] { return now += std::chrono::milliseconds(10); },
                             .sleep_until = [&](v3d::MonotonicInstant to) { now = to; }};
  const auto open = [&](const v3d::StudioInstrument&) {
    return std::make_unique<v3d::trigger::Usbtmc>(std::make_unique<HostilePort>(input));
  };
  v3d::trigger::ScpiGenerator generator(trigger_of(input.number<uint8_t>()), open,
                                        v3d::trigger::open_output_line, clock);
  generator.arm({.count = 25});
  generator.start();
  generator.stop();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  FuzzInput input(data, size);
  try {
    run_generator(input);
  } catch (const v3d::InputError&) {
  }
  return 0;
}
