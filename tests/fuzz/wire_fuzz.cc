// Fuzz target: every decoder of the wire. A decoded message encodes to bytes that decode again.
#include <cstdlib>

#include "wire/codec.h"

namespace {

template <class M>
void check(std::span<const uint8_t> bytes) {
  if (const auto message = v3d::decode<M>(bytes)) {
    if (!v3d::decode<M>(v3d::encode(*message))) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span bytes(data, size);
  check<v3d::PulseMessage>(bytes);
  check<v3d::FrameMessage>(bytes);
  check<v3d::MeshMessage>(bytes);
  check<v3d::CommandMessage>(bytes);
  check<v3d::ReplyMessage>(bytes);
  check<v3d::HealthMessage>(bytes);
  check<v3d::EventMessage>(bytes);
  check<v3d::PreviewMessage>(bytes);
  check<v3d::SessionMessage>(bytes);
  check<v3d::FrameKeyMessage>(bytes);
  check<v3d::ShardMessage>(bytes);
  check<v3d::ShardMeshMessage>(bytes);
  v3d::decode_frame_head(bytes);
  return 0;
}
