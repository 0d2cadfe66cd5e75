// Bytes as commands, before and behind the seal: without the studio's seal none is believed; with
// it the gate believes a command of now once, and never twice. And bytes as the file of a key.
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "daemon/command_gate.h"

namespace {

constexpr v3d::RealtimeInstant kBegan = v3d::from_ns<v3d::Realtime>(0);

const v3d::StudioKey& key() {
  static const v3d::StudioKey made = v3d::StudioKey::parse(std::string(64, '7'), "studio.key");
  return made;
}

void must(bool condition) {
  if (!condition) std::abort();
}

void read_as_sealed(std::span<const uint8_t> bytes) {
  v3d::Bytes sealed(bytes.begin(), bytes.end());
  if (sealed.size() <= v3d::kSealSize) return;
  key().seal(sealed);
  must(key().has_sealed(sealed));
  const auto command = v3d::decode<v3d::CommandMessage>(sealed);
  const v3d::RealtimeInstant now = command ? command->sent : kBegan;
  v3d::CommandGate gate("cap01", kBegan);
  gate.set_key(key());
  gate.admit(sealed, now);
  must(!gate.admit(sealed, now));
  must(gate.counts().believed <= 1 && gate.counts().forged == 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(data, size);
  v3d::CommandGate gate("cap01", kBegan);
  gate.set_key(key());
  must(!gate.admit(bytes, v3d::Realtime::now()));
  read_as_sealed(bytes);
  try {
    v3d::StudioKey::parse({reinterpret_cast<const char*>(data), size}, "studio.key");
  } catch (const v3d::InputError&) {
  }
  return 0;
}
