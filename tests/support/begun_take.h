// The take.toml of a take that is being recorded, for tests.
#pragma once

#include <string>
#include <vector>

#include "take/take.h"

namespace v3d::test {

inline take::TakeInfo begun_take(const std::vector<std::string>& cameras) {
  return {.name = "kendo-07",
          .studio = "dojo",
          .rate_hz = 25,
          .pulses = 0,
          .state = take::TakeState::kRecording,
          .software_version = "0.1.0",
          .started = {},
          .cameras = cameras};
}

}  // namespace v3d::test
