// Ctrl-C and SIGTERM during long work: the work stops at the next frame and cleans up after itself.
#pragma once

namespace v3d::ctl {

/// From now on the two signals are remembered instead of ending the process.
void catch_interrupts();
/// One of them came.
bool interrupted();
/// Throws std::runtime_error("interrupted") when one of them came.
void stop_if_interrupted();

}  // namespace v3d::ctl
