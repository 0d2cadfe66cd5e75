// Test that the filter of commands keeps nothing of forgeries. This program counts every
// allocation.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "daemon/control/command_replay_filter.h"
#include "support/allocation_count.h"

namespace v3d::control {
namespace {

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);

/// Commands of senders without the key: with another key, signed by a stranger, cut, and noise.
std::vector<wire::Bytes> forged_commands() {
  wire::CommandMessage command;
  command.sender = std::string(1000, 's');
  command.to = {"cap01"};
  wire::Bytes cut = encode_with_mac(command, wire::StudioKey::make());
  cut.resize(cut.size() / 2);
  return {encode_with_mac(command, wire::StudioKey::make()),
          sign_message(encode(command), wire::SigningKey::make()),
          cut,
          wire::Bytes(16'000, 7),
          {}};
}

TEST(CommandReplayFilterAllocations, are_none_for_forged_commands) {
  const std::vector<wire::Bytes> forged = forged_commands();
  for (const bool has_members : {false, true}) {
    CommandReplayFilter filter("cap01");
    filter.credentials().set_studio_key(wire::StudioKey::make(), kNow);
    if (has_members) {
      filter.credentials().require_members();
      filter.credentials().set_signing_key(wire::SigningKey::make());
      filter.credentials().set_members(std::make_shared<const wire::MemberList>());
    }
    const int64_t before = test::allocations();
    int admitted = 0;
    for (const wire::Bytes& bytes : forged) admitted += filter.admit(bytes, kNow) ? 1 : 0;
    EXPECT_EQ(test::allocations() - before, 0) << has_members;
    EXPECT_EQ(admitted, 0);
    EXPECT_EQ(filter.counts().forged, std::ssize(forged));
  }
}

}  // namespace
}  // namespace v3d::control
