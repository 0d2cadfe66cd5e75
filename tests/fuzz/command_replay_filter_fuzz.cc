// Fuzz target: commands, with and without a valid MAC, and key files. Without the MAC of the
// studio, no command is executed. With it, a command that holds the nonce is executed once and
// never again.
#include <cstdlib>
#include <string_view>

#include "base/core/error.h"
#include "daemon/control/command_replay_filter.h"

namespace {

constexpr v3d::MonotonicInstant kNow = v3d::from_ns<v3d::Monotonic>(3'600'000'000'000);
constexpr int64_t kNonce = 7;
int64_t draw() { return kNonce; }

const v3d::wire::StudioKey& key() {
  static const v3d::wire::StudioKey made =
      v3d::wire::StudioKey::parse(std::string(64, '7'), "studio.key");
  return made;
}

void must(bool condition) {
  if (!condition) std::abort();
}

void check_admitted_once(v3d::wire::CommandMessage command) {
  command.to[0] = "cap01";
  command.nonces[0] = kNonce;
  const v3d::wire::Bytes authenticated = v3d::wire::encode_with_mac(command, key());
  v3d::control::CommandReplayFilter filter("cap01", draw);
  filter.credentials().set_studio_key(key(), kNow);
  const auto first = filter.admit(authenticated, kNow);
  must(first && first->is_current);
  must(!filter.admit(authenticated, kNow));
}

void check_with_mac(std::span<const uint8_t> bytes) {
  v3d::wire::Bytes authenticated(bytes.begin(), bytes.end());
  if (authenticated.size() <= v3d::wire::kCommandMacSize) return;
  key().add_mac(authenticated);
  must(key().has_valid_mac(authenticated));
  auto command = v3d::wire::decode<v3d::wire::CommandMessage>(authenticated);
  v3d::control::CommandReplayFilter filter("cap01", draw);
  filter.credentials().set_studio_key(key(), kNow);
  filter.admit(authenticated, kNow);
  const auto again = filter.admit(authenticated, kNow);
  must(!again || !again->is_current);
  if (command && !command->to.empty()) check_admitted_once(std::move(*command));
  must(filter.counts().admitted <= 1 && filter.counts().forged == 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(data, size);
  v3d::control::CommandReplayFilter filter("cap01", draw);
  filter.credentials().set_studio_key(key(), kNow);
  must(!filter.admit(bytes, kNow));
  check_with_mac(bytes);
  try {
    v3d::wire::StudioKey::parse({reinterpret_cast<const char*>(data), size}, "studio.key");
  } catch (const v3d::InputError&) {
  }
  return 0;
}
