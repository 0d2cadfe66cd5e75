// Runs kernels, compiled once for each instruction set, on all sets that this processor has.
#pragma once

#include <gtest/gtest.h>
#include <hwy/targets.h>

namespace v3d {

/// Calls `work` once for each instruction set for which kernels are compiled and that this
/// processor has. Kernels called in it, by all threads, use this instruction set. A failed
/// expectation names the set.
template <class Work>
void on_every_instruction_set(const Work& work) {
  struct Reset {
    ~Reset() { hwy::SetSupportedTargetsForTest(0); }
  } const reset;
  for (const auto target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    work();
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace v3d
