// Figures of an evaluation as the commands print them with --json.
#pragma once

#include <nlohmann/json.hpp>

#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/evaluate/evaluate_motion.h"

namespace v3d::ctl {

/// Sets the keys of a comparison with the truth.
void put_truth(nlohmann::ordered_json& json, const TruthReport& report);
nlohmann::ordered_json to_json(const MotionReport& report);

}  // namespace v3d::ctl
