// Sound devices and lamps.
#include <cerrno>
#include <optional>
#include <utility>

#include "base/io/child_process.h"
#include "sound/sound_device.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

/// What `opened`, the result of opening `device`, means.
template <class Device>
Finding finding_of(const std::string& subject, const std::string& device,
                   const io::Result<std::unique_ptr<Device>>& opened, bool is_here) {
  if (opened) return {Verdict::kGood, subject, device + " opens", ""};
  if (opened.error().code == EBUSY) {
    return {Verdict::kGood, subject, device + " is in use, as by v3d-captured", ""};
  }
  return {is_here ? Verdict::kBad : Verdict::kUnknown, subject, opened.error().message,
          is_here
              ? "check the device's cable and its name in the studio file (arecord -L and aplay "
                "-L list the devices); add this user to the group audio"
              : ""};
}

/// Nothing where the sound gets the times of the pulses.
std::optional<Finding> finding_of_pulses(const StudioTrigger& trigger, const StudioSound& sound) {
  const bool is_paced_here = trigger.kind == TriggerKind::kGpio && sound.node == trigger.node;
  if (trigger.is_sensed() || is_paced_here) return std::nullopt;
  return Finding{Finding::Verdict::kBad, "sound of " + sound.node,
                 "no pulse gets a position in the sound, because the trigger is not sensed",
                 "connect a sense line to the trigger's node and describe it in [trigger.sense]"};
}

}  // namespace

std::vector<Finding> check_sound_devices(const Studio& studio, const std::string& node) {
  std::vector<Finding> findings;
  const bool is_here = !node.empty();
  for (const StudioSound& sound : studio.sounds) {
    if (is_here && sound.node != node) continue;
    findings.push_back(finding_of("sound of " + sound.node, sound.device,
                                  sound::open_sound_input(sound, {}), is_here));
    if (auto pulses = finding_of_pulses(studio.trigger, sound)) {
      findings.push_back(*std::move(pulses));
    }
  }
  if (studio.timecode_output && (!is_here || studio.trigger.node == node)) {
    findings.push_back(finding_of("timecode output", studio.timecode_output->device,
                                  sound::open_sound_output(*studio.timecode_output), is_here));
  }
  return findings;
}

std::optional<Finding> check_lights(const Studio& studio, const std::string& node) {
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
