// studio.toml: everything about one studio that does not change between takes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/config/chroma_key.h"
#include "base/geometry/box.h"
#include "base/image/image.h"

namespace v3d {

/// [[node]]: a PC that runs v3d-captured (cameras or the trigger hang on it) or v3d-recond.
struct StudioNode {
  std::string name;
  /// Ed25519 public key that verifies the node's signatures of takes (wire/signing_key.h): 64
  /// hexadecimal digits. Empty: the key is unknown.
  std::string public_key = {};
};

enum class CameraKind { kAravis, kV4l2 };
enum class Edge { kRising, kFalling };

/// [[camera]]; a field that is missing takes the value in [camera_defaults], else the one here.
struct StudioCamera {
  std::string name;  ///< as in calib.toml
  std::string node;
  CameraKind kind = CameraKind::kAravis;
  std::string address;  ///< aravis: serial number, or IP address; v4l2: device path
  PixelFormat pixel_format = PixelFormat::kBayerRG8;
  ChromaKey chroma_key = ChromaKey::kNone;  ///< what the walls it sees are painted in
  double exposure_us = 1000;
  double gain_db = 0;
  std::string trigger_line = "Line1";
  Edge trigger_edge = Edge::kRising;  ///< of the line, that begins the exposure
  int packet_size = 9000;             ///< bytes of a GVSP packet, headers included
  int packet_delay_ns = 0;
  bool packet_resend = true;  ///< lost packets are asked for again
  int buffers = 8;
  bool packet_socket = true;  ///< receive by packet socket where permitted (CAP_NET_RAW)
  bool ptp = false;           ///< its clock follows PTP (IEEE 1588)
  bool chunk_data = false;    ///< it sends its own account with every frame
  // v4l2 only. There is no standard control for the external trigger: which one, and its value.
  std::optional<uint32_t> trigger_control;  ///< empty: the camera runs free
  int trigger_value = 1;
  std::optional<ImageSize> size;  ///< `width`, `height`; else what the camera has

  /// Nothing triggers it; its frames are labelled with the sensed pulse that is nearest in time.
  bool runs_free() const { return kind == CameraKind::kV4l2 && !trigger_control; }
};

enum class TriggerKind { kSimulated, kGpio, kScpi };

/// A line of a GPIO chip.
struct StudioLine {
  std::string chip;         ///< name ("gpiochip0"), label or path
  std::string line;         ///< name, or its number on the chip in decimal
  bool active_low = false;  ///< a pulse is the low level, and begins with a falling edge
};

/// Where a signal generator hangs: "usb:VVVV:PPPP[:SERIAL]" or "serial:/dev/ttyUSB0".
struct StudioInstrument {
  std::filesystem::path device = {};  ///< of a serial port; empty: USB
  int baud = 115'200;                 ///< of a serial port
  uint16_t vendor = 0;
  uint16_t product = 0;
  std::string serial = {};  ///< empty: any

  std::string text() const;
};

/// The command languages of signal generators (trigger/scpi/scpi_dialect.h).
enum class Dialect { kKeysight33500, kRigolDg, kSiglentSdg, kBnc575 };

/// [trigger]
struct StudioTrigger {
  std::string node;
  TriggerKind kind = TriggerKind::kSimulated;
  double rate_hz = 25;
  double pulse_width_us = 1000;
  std::filesystem::path wire;       ///< simulated: the socket that stands for the trigger cable
  StudioLine output;                ///< gpio: chip, line, active_low
  StudioInstrument instrument;      ///< scpi
  Dialect dialect{};                ///< scpi
  int channel = 1;                  ///< scpi: output of the instrument
  double level_v = 3.3;             ///< scpi: of a pulse, into a high impedance; else 0 V
  std::optional<StudioLine> gate;   ///< scpi, [trigger.gate]: to the instrument's gate input
  std::optional<StudioLine> sense;  ///< gpio and scpi, [trigger.sense]: sees the pulses themselves

  /// Somebody sees the pulses; otherwise the generator's own account is the only one.
  bool is_sensed() const { return kind == TriggerKind::kSimulated || sense.has_value(); }
};

/// [space]: the part of the world that is reconstructed.
struct StudioSpace {
  Box bounds;
};

/// Where the studio key is, unless the studio file says otherwise.
inline constexpr char kDefaultKey[] = "/etc/v3d/studio.key";
/// Where the key of the operator of a PC is, unless the studio file says otherwise.
inline constexpr char kDefaultOperatorKey[] = "/etc/v3d/operator.key";

/// [network]; a relative path is taken from the folder of the studio file.
struct StudioNetwork {
  std::string lcm_url = "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=16777216";
  /// Where live frames travel instead: those of a pulse in the group pulse modulo size(). Empty:
  /// with all else. Each has an address and a port of its own.
  std::vector<std::string> frame_groups;
  std::filesystem::path key = kDefaultKey;  ///< file of the studio key (wire/studio_key.h)
  /// File of the member list (wire/member_list.h). Empty: every holder of the studio key may
  /// command and reply.
  std::filesystem::path members = {};
  /// Ed25519 public key that verifies the member list: 64 hexadecimal digits. Empty without a list.
  std::string authority = {};
  /// File of the key with which this PC's operator signs commands, where there is a list.
  std::filesystem::path operator_key = kDefaultOperatorKey;
  std::string metrics;  ///< where daemons serve Prometheus, "127.0.0.1:9464"; empty: nowhere
};

/// [storage]; relative paths are taken from the folder of the studio file.
struct StudioStorage {
  std::filesystem::path takes;       ///< every take is a folder in here
  std::filesystem::path background;  ///< one plate model per camera
  std::filesystem::path calib;       ///< calib.toml
  /// File of the key with which a node signs the takes it records. Empty: takes are not signed.
  std::filesystem::path signing_key = {};
};

enum class Quality { kLive, kHigh };

/// [reconstruction]
struct StudioReconstruction {
  /// `node`, or `nodes`, which share the pulses; sorted. Never empty.
  std::vector<std::string> nodes;
  double voxel_m = 0.01;
  int min_views = 4;  ///< fewer cameras than this see a voxel: it is empty
  Quality quality = Quality::kLive;
  int threads = 0;  ///< 0: one per core
  double deadline_ms =
      200;  ///< a frame set waits so long for its last camera, counted from its first
};

/// [viewer]; relative paths are taken from the folder of the studio file.
struct StudioViewer {
  std::string listen = "127.0.0.1:8330";  ///< v3d-viewd's address and port
  std::filesystem::path token;            ///< file with the token browsers must show; empty: none
  std::filesystem::path page = "/usr/share/v3d/viewer";  ///< folder of the built page
  bool control = false;  ///< the studio page may arm, start, stop and abort
  /// File with the token that operators type into it.
  std::filesystem::path operator_token = "/etc/v3d/operator.token";
};

struct Studio {
  std::string name;
  std::filesystem::path path;  ///< the file it was read from
  std::vector<StudioNode> nodes;
  std::vector<StudioCamera> cameras;
  StudioTrigger trigger;
  StudioSpace space;
  StudioNetwork network;
  StudioStorage storage;
  StudioReconstruction reconstruction;
  StudioViewer viewer;

  std::vector<StudioCamera> cameras_of(std::string_view node) const;
  /// The node is one of the reconstruction.
  bool reconstructs(std::string_view node) const;
};

/// Throws InputError with file, line and field for anything missing, ill-typed, unknown (a misspelt
/// field is named), out of range, or inconsistent (two cameras of one name, a node that does not
/// exist).
Studio load_studio(const std::filesystem::path& path);
Studio parse_studio(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d
