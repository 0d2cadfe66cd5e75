// Runs kernels, compiled once for each instruction set, on all sets that this processor supports.
#pragma once

#include <hwy/targets.h>

#include <cstdint>

namespace v3d::recon {

template <class Work>
void on_every_instruction_set(const Work& work) {
  for (int64_t rest = hwy::SupportedTargets(); rest != 0; rest &= rest - 1) {
    hwy::SetSupportedTargetsForTest(rest & -rest);
    work();
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace v3d::recon
