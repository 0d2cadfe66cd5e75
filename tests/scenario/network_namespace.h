// A network of the test's own: nothing of it reaches the host, and tests can run side by side.
#pragma once

#include <string>

namespace v3d::test {

/// Moves this process (and its children) into user and network namespaces of its own, where `lo`
/// has a multicast route and the addresses of simulated cameras. Call before any thread begins.
/// Empty when that worked, else why not.
std::string enter_network_of_its_own();

}  // namespace v3d::test
