// A simulated walk with a board, as sightings.
#pragma once

#include <vector>

#include "calib/rig/pair_poses.h"
#include "sim/board_walk.h"

namespace v3d::calib {

std::vector<CameraSightings> walk_with(const Board& board, const Rig& rig,
                                       const sim::BoardWalkOptions& options);

/// How far each camera is from where it truly is, after the two worlds are brought together.
struct PoseErrors {
  std::vector<double> distance_mm;
  std::vector<double> angle_deg;
};
PoseErrors pose_errors(const Rig& found, const Rig& truth);

/// What the InputError says; empty when nothing was thrown.
template <class Call>
std::string refusal_of(Call call);

}  // namespace v3d::calib

#include "base/error.h"

template <class Call>
std::string v3d::calib::refusal_of(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}
