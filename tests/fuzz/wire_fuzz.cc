// Fuzz target: every decoder of the wire. A decoded message encodes to bytes that decode again.
#include <cstdlib>

#include "wire/codec.h"

namespace {

template <class M>
void check(std::span<const uint8_t> bytes) {
  if (const auto message = v3d::wire::decode<M>(bytes)) {
    if (!v3d::wire::decode<M>(v3d::wire::encode(*message))) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(data, size);
  check<v3d::wire::PulseMessage>(bytes);
  check<v3d::wire::FrameMessage>(bytes);
  check<v3d::wire::MeshMessage>(bytes);
  check<v3d::wire::CommandMessage>(bytes);
  check<v3d::wire::ReplyMessage>(bytes);
  check<v3d::wire::HealthMessage>(bytes);
  check<v3d::wire::EventMessage>(bytes);
  check<v3d::wire::PreviewMessage>(bytes);
  check<v3d::wire::SessionMessage>(bytes);
  check<v3d::wire::FrameKeyMessage>(bytes);
  check<v3d::wire::ShardMessage>(bytes);
  check<v3d::wire::ShardMeshMessage>(bytes);
  v3d::wire::decode_frame_head(bytes);
  return 0;
}
