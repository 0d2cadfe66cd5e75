// Verdicts on cameras and sound of `v3dctl check`, and contact sheets of the images of cameras.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/motion_stops.h"
#include "daemon/control/operator_client.h"
#include "v3dctl/takes/clap.h"

namespace v3d::ctl {

// Claps detected by `v3dctl check`, and their offset from the pictures: check_sound.cc

/// The ends of motions in the pictures of each camera, by its name.
using CameraStops = std::map<std::string, std::vector<segmentation::MotionStop>>;

/// Result of the clap detection of one node, from "sound" in the detail of its reply.
struct NodeSoundCheck {
  std::string node;
  std::string fault;               ///< why it could detect no clap; empty: none
  std::optional<ClapOffset> clap;  ///< empty: no clap
};

/// Empty for a node without sound input. The clap has no cameras yet. Throws a Json exception when
/// the detail is no result of a check.
std::optional<NodeSoundCheck> parse_sound(const nlohmann::ordered_json& detail,
                                          const std::string& node);

/// Adds the cameras of all nodes whose motion stops within half a second of a clap.
void compare_with_pictures(const CameraStops& stops, std::vector<NodeSoundCheck>& sounds);

/// One line for each node with sound input.
std::vector<std::string> sound_lines(const std::vector<NodeSoundCheck>& sounds);
/// [{node, fault, sound_pulse, picture_pulse, cameras [{name, offset_ms}], offset_ms,
/// uncertainty_ms}]
nlohmann::ordered_json sounds_json(const std::vector<NodeSoundCheck>& sounds);

// Verdicts of `v3dctl check` about the cameras, from what the nodes measured. Pure.

/// Measurements of one camera during the check, from "checked" in the detail of a node's reply.
struct CameraMeasurement {
  std::string node;
  std::string camera;
  bool ready = true;  ///< false: the values below are not set
  int64_t pulses = 0;
  int64_t received = 0;  ///< frames
  int64_t missing = 0;
  int64_t dropped = 0;  ///< missing frames that the node was too slow to examine
  int64_t duplicate = 0;
  int64_t suspect = 0;
  double clipped = 0;                  ///< share of samples of 250 and more, 0 to 1
  double dark = 0;                     ///< share of samples of 5 and less, 0 to 1
  double focus = 0;                    ///< variance of the Laplacian
  std::optional<double> plates_focus;  ///< the same of the background plates
  std::optional<double> foreground;    ///< share of pixels, 0 to 1
  double flicker_amplitude = 0;        ///< of the brightness over the pulses, share of its mean
  std::optional<double> beat_hz;       ///< of the lamps with the pulses; empty under steady light
  std::optional<double> rate_without_flicker_hz;  ///< of pulses; empty if none is known
  std::vector<segmentation::MotionStop> motion_stops;
};

struct CheckReport {
  std::vector<CameraMeasurement> cameras;  ///< in the order of nodes
  std::vector<NodeSoundCheck> sounds;      ///< of the nodes with sound input, in their order
  std::vector<std::string> unreadable;     ///< nodes whose reply cannot be parsed
};

/// Parses the replies of all nodes; no reply is trusted to be well-formed.
CheckReport parse_check_replies(const control::Answer& answer);

struct CameraVerdict {
  enum class Grade { kGood, kLook, kBad } grade = Grade::kGood;
  std::string what;    ///< the faults, separated by "; ", or "all well"
  std::string remedy;  ///< of the worst fault; empty without a fault
};
CameraVerdict judge(const CameraMeasurement& camera);

/// One line for each camera: grade, frames, faults and remedy.
std::vector<std::string> check_lines(const std::vector<CameraMeasurement>& cameras);
/// {"good", "cameras" [{"name", "node", "verdict", "text", "remedy", measurements}], "sounds"
/// (sounds_json()), "unreadable"}
nlohmann::ordered_json check_json(const CheckReport& report);
/// Whether no camera is bad and all replies were readable.
bool all_good(const CheckReport& report);

// Contact sheet: the images of all cameras on one picture. Pure.

struct SheetImage {
  std::string name;
  std::optional<Image> image;  ///< RGB8; empty: no image was received
  std::optional<Mask> mask;    ///< its outline is drawn; ignored if its size differs from the image
};

/// Arranges the images in a nearly square grid, each below its name. Result: RGB8.
Image contact_sheet(const std::vector<SheetImage>& images);

/// Draws white text in letters of 10 x 14 pixels, clipped to the image. (x, y): upper left corner.
/// Characters other than letters, digits, spaces and "-_.:/" become boxes.
void draw_text(Image& image, int x, int y, const std::string& text);

}  // namespace v3d::ctl
