// Timecode of the videos of scenes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "take/take_sound.h"
#include "v3dctl/scene/scene_sound.h"

namespace v3d::ctl {

/// A timecode that counts the pictures of a video, "10:00:03:12": hours, minutes and seconds are
/// those of `timecode`, the frames count pictures. With dropped numbers, "10:00:03;12", where both
/// have them: 29.97 or 59.94 pictures per second.
std::string video_timecode(const take::PulseTimecode& timecode, double pictures_per_second);

struct SceneTimecode {
  std::string text;     ///< video_timecode() of a picture; empty: the scene has none
  std::string problem;  ///< why takes with timecode give the scene none; empty: they do
};

/// The timecode of a scene at `seconds`. It is that of its takes, where all takes with timecode
/// play at their own speed, do not repeat, and agree to half a picture; each is shifted to this
/// time. Takes without timecode do not count. Throws as TakeTimecode.
SceneTimecode scene_timecode(std::span<const SoundClip> clips, double seconds,
                             double pictures_per_second);

}  // namespace v3d::ctl
