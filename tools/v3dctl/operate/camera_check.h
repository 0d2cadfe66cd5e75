// What v3dctl check says of what the nodes saw. Pure.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/operator_client.h"

namespace v3d::ctl {

/// What a node tells of one camera; as `checked` in the detail of its reply.
struct CameraSeen {
  std::string node;
  std::string camera;
  bool ready = true;  ///< false: all that follows is empty
  int64_t pulses = 0;
  int64_t received = 0;
  int64_t missing = 0;
  int64_t duplicate = 0;
  int64_t suspect = 0;
  double clipped = 0;  ///< shares, 0 to 1
  double dark = 0;
  double focus = 0;
  std::optional<double> plates_focus;
  std::optional<double> foreground;
};

struct CheckFindings {
  std::vector<CameraSeen> cameras;      ///< in the order of nodes
  std::vector<std::string> unreadable;  ///< nodes that checked and whose account cannot be read
};
/// Bytes come from the network: what is no account of a check is named, not believed.
CheckFindings read_check(const Answer& answer);

struct CameraVerdict {
  enum class Grade { kGood, kLook, kBad } grade = Grade::kGood;
  std::string what;    ///< "all well", else what is wrong, parts separated by "; "
  std::string remedy;  ///< of the worst of it; empty when all is well
};
CameraVerdict judge(const CameraSeen& seen);

/// One line a camera: its verdict, what was measured, and what to do.
std::vector<std::string> check_lines(const std::vector<CameraSeen>& cameras);
/// {"good", "cameras" [{"name", "node", "verdict", "text", "remedy", and what was measured}]}
nlohmann::ordered_json check_json(const CheckFindings& findings);
/// No camera is bad, and every account was read.
bool all_good(const CheckFindings& findings);

}  // namespace v3d::ctl
