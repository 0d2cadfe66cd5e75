// Live meshes that v3dctl reconstruct makes again to the byte.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "codec/frame_codec.h"
#include "recon/pipeline/compact_frame.h"
#include "take/logs/mesh_file.h"

namespace v3d::test {

/// The pulses of meshes that depend on no pulse without a mesh and on no frame that came too late
/// for its set: from each key frame on, up to the first such pulse. A busy machine has some.
inline std::vector<int64_t> comparable_meshes(take::MeshFileReader& live) {
  std::vector<int64_t> pulses;
  recon::CompactDecoder decoder;
  int64_t next = 0;
  bool whole = true;
  for (const int64_t pulse : live.pulses()) {
    const auto compact = live.read(pulse).value();
    if (!compact || decoder.decode(*compact) != codec::DecodeStatus::kOk) {
      ADD_FAILURE() << "pulse " << pulse << " is damaged";
      return pulses;
    }
    whole = (whole && pulse == next) || pulse % codec::EncoderOptions().key_every == 0;
    whole = whole && decoder.frame().missing == 0;
    next = pulse + 1;
    if (whole) pulses.push_back(pulse);
  }
  return pulses;
}

}  // namespace v3d::test
