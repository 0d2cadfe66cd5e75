// Parameters of a pulse train: rate, width and count.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/core/time.h"

namespace v3d {

struct PulseTrain {
  double rate_hz = 25;
  Duration width = std::chrono::milliseconds(1);
  std::optional<int64_t> count;  ///< pulses; empty: until stopped
};

/// Throws InputError when no generator can make the train. The message starts with `source`, the
/// name of the generator.
void check_train(const PulseTrain& train, const std::string& source);

}  // namespace v3d
