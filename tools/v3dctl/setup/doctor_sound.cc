#include <cerrno>

#include "sound/sound_input.h"
#include "sound/sound_output.h"
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

}  // namespace

std::vector<Finding> check_sound_devices(const Studio& studio, const std::string& node) {
  std::vector<Finding> findings;
  const bool is_here = !node.empty();
  for (const StudioSound& sound : studio.sounds) {
    if (is_here && sound.node != node) continue;
    findings.push_back(finding_of("sound of " + sound.node, sound.device,
                                  sound::open_sound_input(sound, {}), is_here));
  }
  if (studio.timecode_output && (!is_here || studio.trigger.node == node)) {
    findings.push_back(finding_of("timecode output", studio.timecode_output->device,
                                  sound::open_sound_output(*studio.timecode_output), is_here));
  }
  return findings;
}

}  // namespace v3d::ctl
