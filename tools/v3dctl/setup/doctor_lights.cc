#include "base/io/child_process.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {

std::optional<Finding> check_lights(const Studio& studio, const std::string& node) {
  using Verdict = Finding::Verdict;
  if (!studio.lights || studio.lights->node != node) return std::nullopt;
  const std::string program = "v3d-lights";
  if (!has_program(program)) {
    return Finding{Verdict::kBad, "lights", program + " is not installed",
                   "apt install v3d-lights ola, or remove [lights] from the studio file"};
  }
  const ProcessResult result = run_process({program}, Output::kCaptureBoth);
  if (result.status == 0) return Finding{Verdict::kGood, "lights", "olad answers", ""};
  return Finding{Verdict::kBad, "lights", result.errors.substr(0, result.errors.find('\n')),
                 "systemctl start olad, or remove [lights] from the studio file"};
}

}  // namespace v3d::ctl
