// studio.toml: the configuration of a studio, which does not change between takes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_values.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/camera_format.h"
#include "base/image/image.h"

namespace v3d {

/// [[node]]: a PC that runs v3d-captured (with cameras or the trigger connected) or v3d-recond.
struct StudioNode {
  std::string name;
  /// Ed25519 public key that verifies the node's signatures of takes (wire/signatures.h): 64
  /// hexadecimal digits. Empty: the key is unknown.
  std::string public_key = {};
};

enum class CameraKind { kAravis, kV4l2 };
enum class Edge { kRising, kFalling };

/// A feature (GenICam) or control (V4L2) of a camera, and its value as text: "true", "4600", "0.5".
struct CameraFeature {
  std::string name;
  std::string value;
  friend bool operator==(const CameraFeature&, const CameraFeature&) = default;
};

/// Keys of GigE Vision action commands. A camera obeys a command with the same keys whose mask has
/// a bit in common with its own.
struct ActionKeys {
  int signal = 1;  ///< number of the action signal of the camera: "Action1"
  uint32_t device_key = 1;
  uint32_t group_key = 1;
  uint32_t group_mask = 1;  ///< not 0
  friend bool operator==(const ActionKeys&, const ActionKeys&) = default;
};

/// [[camera]]. A missing field has the value in [camera_defaults], else the default here.
struct StudioCamera {
  std::string name;  ///< as in calib.toml
  std::string node;
  CameraKind kind = CameraKind::kAravis;
  /// aravis: serial number, or IP address; v4l2: device path, serial number or bus path
  /// (base/config/v4l2_address.h).
  std::string address;
  CameraFormat pixel_format = PixelFormat::kBayerRG8;
  ChromaKey chroma_key = ChromaKey::kNone;  ///< colour of the background walls that the camera sees
  double exposure_us = 1000;
  double gain_db = 0;
  std::string trigger_line = "Line1";
  Edge trigger_edge = Edge::kRising;  ///< edge of the line that starts the exposure
  int packet_size = 9000;             ///< bytes of a GVSP packet, headers included
  int packet_delay_ns = 0;
  bool packet_resend = true;  ///< request lost packets again
  int buffers = 8;
  bool packet_socket = true;      ///< receive by packet socket where permitted (CAP_NET_RAW)
  bool ptp = false;               ///< the camera clock follows PTP (IEEE 1588)
  bool chunk_data = false;        ///< the camera sends its own metadata with every frame
  std::optional<ImageSize> size;  ///< `width`, `height`; empty: the camera's current size
  /// [camera.features], in the order of the file; those of [camera_defaults.features] come first.
  std::vector<CameraFeature> features;
  /// The file has tables [[camera.features]] or [[camera_defaults.features]]: `features` may name a
  /// feature again, and a camera's own value replaces none of the defaults.
  bool repeats_features = false;
  // aravis only.
  int offset_x = 0;  ///< upper left corner of the region on the sensor, pixels; with `size` only
  int offset_y = 0;
  int binning = 1;  ///< pixels of the sensor that make one pixel of the image, in x and in y
  bool reverse_x = false;
  bool reverse_y = false;
  std::optional<double> black_level;  ///< in the camera's unit; empty: as it is
  std::string strobe_line;            ///< output that is active during the exposure; empty: none
  std::string user_set;               ///< loaded before all other settings; empty: none
  std::optional<ActionKeys> action;   ///< action trigger: copied from [trigger]; `trigger_line` and
                                      ///< `trigger_edge` are not used
  // v4l2 only. V4L2 has no standard control for the external trigger: its id, and the value to set.
  std::optional<uint32_t> trigger_control;  ///< empty: the camera is free-running
  int trigger_value = 1;

  /// True for a free-running camera: it has no trigger, and each frame gets the sensed pulse
  /// nearest in time.
  bool is_free_running() const { return kind == CameraKind::kV4l2 && !trigger_control; }
};

enum class TriggerKind { kSimulated, kGpio, kScpi, kAction };

/// A line of a GPIO chip.
struct StudioLine {
  std::string chip;         ///< name ("gpiochip0"), label or path
  std::string line;         ///< name, or its number on the chip in decimal
  bool active_low = false;  ///< a pulse is the low level and starts with a falling edge
};

/// Address of a signal generator: "usb:VVVV:PPPP[:SERIAL]" or "serial:/dev/ttyUSB0".
struct StudioInstrument {
  std::filesystem::path device = {};  ///< of a serial port; empty: USB
  int baud = 115'200;                 ///< of a serial port
  uint16_t vendor = 0;
  uint16_t product = 0;
  std::string serial = {};  ///< empty: any

  std::string text() const;
};

/// Command languages of signal generators (trigger/scpi/scpi_dialect.h).
enum class Dialect { kKeysight33500, kRigolDg, kSiglentSdg, kBnc575 };

/// A camera that acknowledges action commands.
struct ActionCamera {
  std::string name;
  std::string address;  ///< IPv4
};

/// The time scale of the PTP clock of the cameras.
enum class PtpScale {
  kTai,  ///< as the standard: this PC's CLOCK_TAI
  kUtc,  ///< this PC's CLOCK_REALTIME, of a PTP master without TAI
};

/// The fields of [trigger] of an action trigger.
struct StudioAction {
  ActionKeys keys;
  std::string broadcast;  ///< IPv4 address to which commands are sent, port 3956
  double lead_ms = 10;    ///< from a command to its pulse; half a period where that is shorter
  PtpScale clock = PtpScale::kTai;
  std::vector<ActionCamera> cameras;  ///< all cameras of the studio that are triggered
};

/// [trigger]
struct StudioTrigger {
  std::string node;
  TriggerKind kind = TriggerKind::kSimulated;
  double rate_hz = 25;
  double pulse_width_us = 1000;
  std::filesystem::path wire;   ///< simulated: the socket of the simulated trigger cable
  StudioLine output;            ///< gpio: chip, line, active_low
  StudioInstrument instrument;  ///< scpi
  Dialect dialect{};            ///< scpi
  int channel = 1;              ///< scpi: output of the instrument
  double level_v = 3.3;         ///< scpi: high level of a pulse, V, high impedance; low level: 0 V
  StudioAction action;          ///< action
  std::optional<StudioLine> gate;   ///< scpi, [trigger.gate]: line to the instrument's gate input
  std::optional<StudioLine> sense;  ///< gpio and scpi, [trigger.sense]: sense line

  /// True when a sense line reads the pulses back, or cameras acknowledge them; otherwise only the
  /// commanded pulses are known.
  bool is_sensed() const {
    return kind == TriggerKind::kSimulated || kind == TriggerKind::kAction || sense.has_value();
  }
};

/// [space]: the part of the world that is reconstructed.
struct StudioSpace {
  Box bounds;
};

/// Default file of the studio key.
inline constexpr char kDefaultKey[] = "/etc/v3d/studio.key";
/// Default file of the key of the operator of a PC.
inline constexpr char kDefaultOperatorKey[] = "/etc/v3d/operator.key";

/// [network]; relative paths start at the folder of the studio file.
struct StudioNetwork {
  std::string lcm_url = "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=16777216";
  /// Multicast groups of the live frames, as LCM URLs; the frames of a pulse use group pulse modulo
  /// size(). Empty: frames use `lcm_url`, like all other messages. Each group has an address and a
  /// port of its own.
  std::vector<std::string> frame_groups;
  std::filesystem::path key = kDefaultKey;  ///< file of the studio key (wire/secret_keys.h)
  /// File of the member list (wire/member_list.h). Empty: every holder of the studio key may send
  /// commands and replies.
  std::filesystem::path members = {};
  /// Ed25519 public key that verifies the member list: 64 hexadecimal digits. Empty without a list.
  std::string authority = {};
  /// File of the key with which the operator of this PC signs commands, when there is a member
  /// list.
  std::filesystem::path operator_key = kDefaultOperatorKey;
  std::string metrics;  ///< address of the Prometheus endpoint, "127.0.0.1:9464"; empty: none
};

/// [storage]; relative paths start at the folder of the studio file.
struct StudioStorage {
  std::filesystem::path takes;       ///< folder with one folder per take
  std::filesystem::path background;  ///< folder of the background model: one plate model per camera
  std::filesystem::path calib;       ///< calib.toml
  /// File of the key with which a node signs the takes it records. Empty: takes are not signed.
  std::filesystem::path signing_key = {};
};

/// Take requests store the numbers.
enum class Quality {
  kLive = 0,    ///< the visual hull
  kHigh = 1,    ///< carved and deformed; about a second a frame
  kMedium = 2,  ///< deformed within the live budget
};

/// [reconstruction]
struct StudioReconstruction {
  /// The field `node`, or `nodes`, which share the pulses. Sorted; never empty.
  std::vector<std::string> nodes;
  double voxel_m = 0.01;
  int min_views = 4;  ///< a voxel that fewer cameras see is empty
  Quality quality = Quality::kMedium;
  int threads = 0;           ///< 0: one per core
  double deadline_ms = 200;  ///< longest wait for the frames of a set, from its first frame
  bool repair = false;       ///< silhouette repair of the pulses for which there is time
  bool performers = false;   ///< labels of performers in the live meshes; with a single node only
};

/// [viewer]; relative paths start at the folder of the studio file.
struct StudioViewer {
  std::string listen = "127.0.0.1:8330";  ///< address and port of v3d-viewd
  std::filesystem::path token;  ///< file with the token that browsers must send; empty: no token
  std::filesystem::path page = "/usr/share/v3d/viewer";  ///< folder of the built page
  bool control = false;  ///< the studio page may arm, start, stop and abort
  /// File with the token that operators enter in the studio page.
  std::filesystem::path operator_token = "/etc/v3d/operator.token";
};

/// [[sound]]: a sound input of a node; at most one per node.
struct StudioSound {
  std::string node;
  std::string device;  ///< ALSA name, or "simulated:..." (sound/sound_device.h)
  int channels = 2;
  int rate_hz = 48'000;
  int pulse_channel = 0;      ///< channel with the trigger pulse, from 1; 0: none
  int timecode_channel = 0;   ///< channel with LTC, from 1; 0: none
  std::string timecode_rate;  ///< name of a TimecodeRate; empty: derived from the signal
};

/// [timecode_output]: longitudinal timecode (LTC) that the trigger's node plays.
struct StudioTimecodeOutput {
  std::string device;  ///< ALSA name
  int channels = 2;    ///< all play the timecode
  int rate_hz = 48'000;
  std::string timecode_rate = "25";  ///< name of a TimecodeRate
  std::string start;  ///< timecode at the start of the daemon, "10:00:00:00"; empty: time of day
};

/// [lights]: scenes of the studio's lamps, sent by DMX.
struct StudioLights {
  std::string node;           ///< the PC on which OLA's daemon olad runs
  int universe = 1;           ///< of olad
  std::vector<uint8_t> work;  ///< values of the channels 1, 2, ... while nothing is recorded
  std::vector<uint8_t> take;  ///< from arming until the end of a take, a check or a background
  double settle_ms = 500;     ///< arming waits this long after a change, until lamps are steady
};

struct Studio {
  std::string name;
  std::filesystem::path path;  ///< the studio file
  std::vector<StudioNode> nodes;
  std::vector<StudioCamera> cameras;
  StudioTrigger trigger;
  StudioSpace space;
  StudioNetwork network;
  StudioStorage storage;
  StudioReconstruction reconstruction;
  StudioViewer viewer;
  std::vector<StudioSound> sounds;
  std::optional<StudioTimecodeOutput> timecode_output;
  std::optional<StudioLights> lights;

  /// The cameras that are connected to a node.
  std::vector<StudioCamera> cameras_of(std::string_view node) const;
  /// The sound input of a node; null when it has none.
  const StudioSound* sound_of(std::string_view node) const;
  /// True when the node is one of the reconstruction nodes.
  bool reconstructs(std::string_view node) const;
};

/// Reads a studio file.
/// Throws InputError with file, line and field for missing, ill-typed, unknown (misspelt),
/// out-of-range and inconsistent fields (two cameras with the same name, an unknown node).
Studio load_studio(const std::filesystem::path& path);
/// Like load_studio(), but reads `text`. Error messages use `path` as the file name; relative paths
/// start at its folder.
Studio parse_studio(std::string_view text, const std::filesystem::path& path);
/// Like parse_studio(), for the studio file of a take. Accepts the longer names of cameras and
/// nodes that earlier versions accepted (kMaxCameraName, kMaxNodeName).
Studio parse_recorded_studio(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
