// Fuzz target: datagrams of GigE Vision action commands, as cameras and the trigger receive them,
// and the accounting of acknowledgements.
#include <cstddef>
#include <cstdint>

#include "base/io/action_packet.h"
#include "fuzz_input.h"
#include "sim/cameras/triggers.h"
#include "trigger/action_generator.h"

namespace {

using v3d::test::must;

void decode(std::span<const uint8_t> datagram) {
  if (const auto command = v3d::io::decode_action_command(datagram)) {
    must(v3d::io::decode_action_command(encode(*command)) == command);
    if (command->time_ns) v3d::sim::from_ptp(*command->time_ns);
  }
  if (const auto acknowledgement = v3d::io::decode_action_acknowledgement(datagram)) {
    must(v3d::io::decode_action_acknowledgement(encode(*acknowledgement)) == acknowledgement);
    v3d::io::text_of(acknowledgement->status);
  }
}

/// A train of commands, and datagrams of two cameras and a stranger in any order.
void account(v3d::test::FuzzInput input) {
  v3d::trigger::ActionAcknowledgements book(
      std::vector<v3d::ActionCamera>{{"cam01", "127.0.0.11"}, {"cam02", "127.0.0.12"}});
  v3d::MonotonicInstant now(std::chrono::seconds(1));
  int64_t sent = 0;
  int64_t last = -1;
  while (!input.empty()) {
    const auto step = input.number<uint8_t>();
    now += std::chrono::milliseconds(step / 4);
    if (step % 4 == 0) {
      book.sent(sent, static_cast<uint16_t>(1 + sent % 16), now + std::chrono::milliseconds(10));
      ++sent;
    } else if (step % 4 == 3) {
      book.expire(now);
    } else if (const auto read = v3d::io::decode_action_acknowledgement(input.bytes(8))) {
      book.received(0x7f00000a + input.number<uint8_t>() % 4, *read, now);
    }
  }
  book.expire(now + std::chrono::seconds(1));
  while (const auto pulse = book.wait({})) {
    must(pulse->number > last && pulse->number < sent);
    last = pulse->number;
  }
  const auto counts = book.counts();
  must(counts.acknowledged + counts.rejected + counts.missing == 2 * sent);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  decode({data, size});
  account({data, size});
  return 0;
}
