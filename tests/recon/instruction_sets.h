// The kernels that are compiled once per instruction set, on each that this processor has.
#pragma once

#include <hwy/targets.h>

#include <cstdint>

namespace v3d {

template <class Work>
void on_every_instruction_set(const Work& work) {
  for (int64_t rest = hwy::SupportedTargets(); rest != 0; rest &= rest - 1) {
    hwy::SetSupportedTargetsForTest(rest & -rest);
    work();
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace v3d
