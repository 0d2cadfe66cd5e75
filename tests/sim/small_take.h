// A small simulated take, for tests of v3d-sim.
#pragma once

#include <filesystem>
#include <string>

#include "base/core/error.h"
#include "sim/rendering/scene.h"
#include "support/message_of.h"
#include "v3d-sim/simulated_take.h"

namespace v3d::sim {

template <class Call>
std::string refusal(Call call) {
  return test::message_of<InputError>(call);
}

inline SimulatedTake small_take(const std::filesystem::path& folder) {
  SimulatedTake take;
  take.folder = folder;
  take.rig = make_rig(3, {96, 64}, 4);
  take.frames = 5;
  take.seed = 4;
  return take;
}

inline void write(const SimulatedTake& take) {
  write_take(take, [](int64_t) {});
}

inline Fault fault(const std::string& camera, int64_t pulse, FaultKind kind) {
  Fault fault;
  fault.camera = camera;
  fault.pulse = pulse;
  fault.kind = kind;
  return fault;
}

}  // namespace v3d::sim
