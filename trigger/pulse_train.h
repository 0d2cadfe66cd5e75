// What a train is asked to be.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/core/time.h"

namespace v3d {

struct PulseTrain {
  double rate_hz = 25;
  Duration width = std::chrono::milliseconds(1);
  std::optional<int64_t> count;  ///< empty: until stopped
};

/// Throws InputError when no generator could make the train. `who` begins the message.
void refuse_impossible(const PulseTrain& train, const std::string& who);

}  // namespace v3d
