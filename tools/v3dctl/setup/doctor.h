// What this PC needs to take part in the studio, checked, each with its remedy.
#pragma once

#include <string>
#include <vector>

#include "base/studio_file.h"

namespace v3d::ctl {

struct Finding {
  enum class Verdict { kGood, kBad, kUnknown } verdict = Verdict::kGood;
  std::string subject;  ///< "receive buffer"
  std::string text;     ///< what was found
  std::string remedy;   ///< what to do; empty where nothing is wrong
};

/// `node`: only its cameras; empty: all cameras of the studio. Asks the cameras over the network
/// (GigE Vision register read), up to a second together, writes to the disk for another second and
/// listens to the nodes for two.
std::vector<Finding> examine(const Studio& studio, const std::string& node);

/// Single checks, for tests and for examine().
Finding check_receive_buffer(long long rmem_max_bytes);
Finding check_disk(const std::string& path);
/// The multicast group of an LCM URL has a route.
Finding check_multicast(const std::string& lcm_url);
Finding check_packet_socket();
/// Cameras given by IP address answer on the GigE Vision control port.
std::vector<Finding> check_cameras(const std::vector<StudioCamera>& cameras);

}  // namespace v3d::ctl
