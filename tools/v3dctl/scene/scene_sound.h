// Sound and timecode of a scene: the sound of its takes, shifted, stretched and mixed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/partial_file.h"
#include "take/take_sound.h"
#include "v3dctl/scene/scene_file.h"
#include "v3dctl/scene/time_stretch.h"

namespace v3d::ctl {

inline constexpr int kSceneSoundRate = 48'000;

/// A take as its sound is read: one clip of a scene.
struct SoundClip {
  SceneTake take;
  double rate_hz = 25;  ///< pulses of the take
  TakePart part;
};

/// The sound of one clip, from a time of the scene on. Before its in point and after its out point
/// it is silent; with Outside::kLoop it repeats. At another speed than 1 its pitch stays
/// (TimeStretch); below kMinSpeed and above kMaxSpeed it is silent. One thread.
class ClipSound {
 public:
  static constexpr double kMinSpeed = 0.1, kMaxSpeed = 10;

  /// `begin_s`: scene time of the first sample.
  ClipSound(SoundClip clip, take::TakeSound sound, double begin_s);

  /// Adds the next samples to `mix`, left and right in turn, kSceneSoundRate per second.
  void add_to(std::vector<float>& mix);

 private:
  /// The next samples with the same state: silent, or in one pass through the part.
  struct Run {
    bool is_silent = true;
    int64_t phase = 0;  ///< samples of the scene since the in point, where it is not silent
    int64_t samples = 0;
  };

  Run next_run(int64_t limit) const;
  std::vector<float> read(const Run& run);
  std::vector<float> read_stretched(const Run& run);
  double pulse_at_phase(int64_t phase) const;

  const SoundClip clip_;
  const float gain_;
  const int64_t pass_;  ///< length of the part, samples of the scene
  take::TakeSound sound_;
  int64_t position_;  ///< samples of the scene since the in point
  std::optional<TimeStretch> stretcher_;
  int64_t stretched_until_ = 0;  ///< phase of its next output
  double source_pulse_ = 0;      ///< of its next input
};

/// Mixes the sound of all takes of a scene.
class SceneSound {
 public:
  /// Opens the sound of all takes whose sound is played. `clips`: the takes of the scene, with
  /// their parts. Throws InputError as TakeSound does.
  SceneSound(const std::vector<SoundClip>& clips, double begin_s);

  /// True when no take has sound in step with its pulses.
  bool is_silent() const { return clips_.empty(); }
  /// The sound files without a map of pulses, with their takes.
  const std::vector<std::string>& unplayed() const { return unplayed_; }
  /// The next samples, left and right in turn, limited to full scale.
  std::vector<float> next(int64_t samples);

 private:
  std::vector<ClipSound> clips_;
  std::vector<std::string> unplayed_;
};

/// A sound file that exists as long as the object, beside the video that ffmpeg makes of it.
class SceneSoundFile {
 public:
  /// Writes `seconds` of `sound` to a hidden file beside `video`. Throws std::runtime_error with
  /// path and cause when the file cannot be written.
  SceneSoundFile(SceneSound& sound, const std::filesystem::path& video, double seconds);
  const std::filesystem::path& path() const { return file_.path(); }

 private:
  const PartialFile file_;
};

// Timecode of the videos of scenes.

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
