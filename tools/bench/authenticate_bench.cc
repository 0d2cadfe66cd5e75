// What a node spends on the verification of a command, and on the checksum of what it records.
#include "base/checksum.h"
#include "daemon/bus/credentials.h"
#include "rates.h"
#include "wire/codec.h"

namespace v3d::bench {
namespace {

CommandMessage stop_command() {
  CommandMessage command;
  command.sender = "ada@desk/1";
  command.verb = CommandVerb::kStop;
  command.take = "kendo-07";
  for (int i = 1; i <= 15; ++i) {
    command.to.push_back("cap" + std::to_string(i));
    command.nonces.push_back(i);
  }
  return command;
}

/// The operator is the last of 30 members.
std::shared_ptr<const MemberList> members_with(const SigningKey& operator_key) {
  auto list = std::make_shared<MemberList>();
  for (int i = 1; i < 30; ++i) {
    list->members.push_back(
        {"cap" + std::to_string(i), Role::kCapture, SigningKey::make().public_key()});
  }
  list->members.push_back({"ada", Role::kOperator, operator_key.public_key()});
  return list;
}

/// Verifies one command again and again.
void verify(benchmark::State& state, const Credentials& credentials) {
  const MonotonicInstant now = Monotonic::now();
  const Bytes command = credentials.seal(encode(stop_command()), now);
  measure(state, 1, 0, [&] {
    if (credentials.open_command(command, now).result != OpenedCommand::Result::kAccepted) {
      state.SkipWithError("the command was rejected");
    }
  });
}

void verify_mac(benchmark::State& state) {
  Credentials credentials;
  credentials.set_studio_key(StudioKey::make(), Monotonic::now());
  verify(state, credentials);
}

void verify_signature(benchmark::State& state) {
  const SigningKey key = SigningKey::make();
  Credentials credentials;
  credentials.set_studio_key(StudioKey::make(), Monotonic::now());
  credentials.require_members();
  credentials.set_members(members_with(key));
  credentials.set_signing_key(key);
  verify(state, credentials);
}

void checksum_of_a_frame(benchmark::State& state) {
  const std::vector<uint8_t> frame(1024 * 768, 77);
  measure(state, 1, static_cast<double>(frame.size()),
          [&] { benchmark::DoNotOptimize(checksum({frame})); });
}

BENCHMARK(verify_mac)->Name("verify/command/mac");
BENCHMARK(verify_signature)->Name("verify/command/signature");
BENCHMARK(checksum_of_a_frame)->Name("checksum/XGA");

}  // namespace
}  // namespace v3d::bench
