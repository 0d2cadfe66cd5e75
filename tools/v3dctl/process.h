// Signals and host name of this process.
#pragma once

#include <string>

namespace v3d::ctl {

/// Installs handlers of SIGINT and SIGTERM that only set a flag. Long work then checks the flag
/// after each frame and removes its temporary files before it ends.
void catch_interrupts();
/// Whether one of the two signals has arrived since catch_interrupts(). Thread-safe.
bool interrupted();
/// Throws std::runtime_error("interrupted") if interrupted().
void stop_if_interrupted();

std::string host_name();

}  // namespace v3d::ctl
