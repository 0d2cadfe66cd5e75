// Benchmark of authentication: verification of commands, health and meshes, signing of meshes, and
// checksums of recorded frames.
#include "base/core/checksum.h"
#include "daemon/bus/credentials.h"
#include "daemon/bus/member_signatures.h"
#include "rates.h"
#include "wire/channels.h"
#include "wire/codec.h"
#include "workload.h"

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

/// A list of 30 members; the operator is the last.
std::shared_ptr<const MemberList> members_with(const SigningKey& operator_key) {
  auto list = std::make_shared<MemberList>();
  for (int i = 1; i < 30; ++i) {
    list->members.push_back(
        {"cap" + std::to_string(i), Role::kCapture, SigningKey::make().public_key()});
  }
  list->members.push_back({"ada", Role::kOperator, operator_key.public_key()});
  return list;
}

/// Verifies one command repeatedly.
void verify(benchmark::State& state, const Credentials& credentials) {
  const MonotonicInstant now = Monotonic::now();
  const Bytes command = credentials.authenticate(encode(stop_command()), now);
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

/// Health message of a capture node, with 80 values.
Bytes health_of_a_node() {
  HealthMessage health;
  health.node = "cap01";
  for (int i = 0; i < 80; ++i) health.values["cam01.frames_of_kind_" + std::to_string(i)] = i;
  return encode(health);
}

Bytes mesh_of_the_performer() {
  MeshMessage mesh;
  mesh.take = "kendo-07";
  mesh.compact = compact_10mm();
  return encode(mesh);
}

/// Verifies one message repeatedly. Its sender is the last of 30 members.
void verify_on_bus(benchmark::State& state, const std::string& channel, const Bytes& message) {
  const SigningKey key = SigningKey::make();
  auto list = std::make_shared<MemberList>(*members_with(SigningKey::make()));
  list->members.back() = {"recon01", Role::kReconstruction, key.public_key()};
  MemberSignatures signatures;
  signatures.set_members(list);
  const MessageOrigin origin{.channel = channel, .session = 1, .sequence = 2, .sent = {}};
  const Bytes bytes = sign_on_bus(message, origin, key);
  measure(state, 1, static_cast<double>(bytes.size()), [&] {
    const auto verified = signatures.verify(bytes, origin, *kind_of(channel), "recon01");
    if (!verified.problem.empty()) state.SkipWithError("the message was rejected");
  });
}

void verify_health(benchmark::State& state) {
  verify_on_bus(state, health_channel("recon01"), health_of_a_node());
}
void verify_mesh(benchmark::State& state) {
  verify_on_bus(state, kMeshChannel, mesh_of_the_performer());
}

/// Signs one mesh, as its sender does.
void sign_mesh(benchmark::State& state) {
  const SigningKey key = SigningKey::make();
  const Bytes mesh = mesh_of_the_performer();
  const MessageOrigin origin{.channel = kMeshChannel, .session = 1, .sequence = 2, .sent = {}};
  measure(state, 1, static_cast<double>(mesh.size()),
          [&] { benchmark::DoNotOptimize(sign_on_bus(mesh, origin, key)); });
}

void checksum_of_a_frame(benchmark::State& state) {
  const std::vector<uint8_t> frame(1024 * 768, 77);
  measure(state, 1, static_cast<double>(frame.size()),
          [&] { benchmark::DoNotOptimize(checksum({frame})); });
}

BENCHMARK(verify_mac)->Name("verify/command/mac");
BENCHMARK(verify_signature)->Name("verify/command/signature");
BENCHMARK(verify_health)->Name("verify/health/signature");
BENCHMARK(verify_mesh)->Name("verify/mesh/signature");
BENCHMARK(sign_mesh)->Name("sign/mesh/signature");
BENCHMARK(checksum_of_a_frame)->Name("checksum/XGA");

}  // namespace
}  // namespace v3d::bench
