// [[camera]] and [camera_defaults] of a studio file.
#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "base/config/studio_fields.h"
#include "base/config/studio_file.h"
#include "base/config/studio_values.h"
#include "base/config/toml_file.h"
#include "base/core/text.h"

namespace v3d {
namespace {

std::string formats_of(CameraKind kind) {
  return kind == CameraKind::kV4l2 ? v4l2_format_names() : pfnc_format_names();
}

CameraFormat read_pixel_format(const TomlTable& table, const StudioCamera& camera) {
  const std::string word = table.text_or("pixel_format", name(camera.pixel_format));
  const auto format = camera_format_from_name(word);
  if (!format) {
    table.fail("pixel_format", "'" + word + "' is unknown; known: " + formats_of(camera.kind));
  }
  return *format;
}

ChromaKey read_chroma_key(const TomlTable& table, ChromaKey fallback) {
  const std::string word = table.text_or("chroma_key", name(fallback));
  const auto key = chroma_key_from_name(word);
  if (!key) table.fail("chroma_key", "'" + word + "' is unknown; known: none, green, blue");
  return *key;
}

/// Settings of V4L2 cameras only; such cameras have no trigger line, packets or gain in dB.
void read_v4l2_settings(const TomlTable& table, StudioCamera& camera) {
  if (table.has("trigger_control")) {
    const std::string text = table.text("trigger_control");
    uint32_t id = 0;
    const bool hex = text.starts_with("0x");
    const char* end = text.data() + text.size();
    const auto parsed = std::from_chars(text.data() + (hex ? 2 : 0), end, id, hex ? 16 : 10);
    if (parsed.ec != std::errc() || parsed.ptr != end) {
      table.fail("trigger_control",
                 "expected the id of a V4L2 control as v4l2-ctl -L shows it, "
                 "such as \"0x009a0914\", found '" +
                     text + "'");
    }
    camera.trigger_control = id;
  }
  constexpr int kMaxInt = std::numeric_limits<int>::max();
  camera.trigger_value =
      ranged_int(table, "trigger_value", camera.trigger_value, -kMaxInt, kMaxInt);
}

/// One side of the region; `fallback`: the side of [camera_defaults], where it has a region.
int read_side(const TomlTable& table, std::string_view key, std::optional<int> fallback) {
  if (!fallback && !table.has(key)) {
    table.fail(key, "missing: expected width and height of the region, in pixels");
  }
  return ranged_int(table, key, fallback.value_or(0), 1, kMaxImageSide);
}

/// The region of the sensor, and how it is read out.
void read_region(const TomlTable& table, StudioCamera& camera) {
  if (table.has("width") || table.has("height")) {
    const auto old = camera.size;
    camera.size =
        ImageSize{read_side(table, "width", old ? std::optional(old->width) : std::nullopt),
                  read_side(table, "height", old ? std::optional(old->height) : std::nullopt)};
  }
  camera.offset_x = ranged_int(table, "offset_x", camera.offset_x, 0, kMaxImageSide);
  camera.offset_y = ranged_int(table, "offset_y", camera.offset_y, 0, kMaxImageSide);
  camera.binning = ranged_int(table, "binning", camera.binning, 1, 8);
  camera.reverse_x = table.boolean_or("reverse_x", camera.reverse_x);
  camera.reverse_y = table.boolean_or("reverse_y", camera.reverse_y);
}

void add_features(const TomlTable& features, StudioCamera& camera) {
  for (const auto& field : features.values()) {
    const CameraFeature feature{field.first, field.second};
    if (!camera.repeats_features) {
      // A camera's own value replaces that of the defaults, at its own place in the order.
      std::erase_if(camera.features,
                    [&](const CameraFeature& other) { return other.name == feature.name; });
    }
    camera.features.push_back(feature);
  }
}

/// [camera.features], or tables [[camera.features]], in which a name may occur again: a feature
/// with a selector, such as LineSelector, has a value for each of its entries.
void read_free_features(const TomlTable& table, StudioCamera& camera) {
  if (!table.has("features")) return;
  if (!table.is_array_of_tables("features")) return add_features(table.table("features"), camera);
  camera.repeats_features = true;
  for (const TomlTable& features : table.tables("features")) add_features(features, camera);
}

/// Settings of GenICam cameras only, and the features of both kinds of cameras.
void read_features(const TomlTable& table, StudioCamera& camera) {
  if (table.has("black_level")) camera.black_level = ranged(table, "black_level", 0, -4096, 4096);
  camera.strobe_line = table.text_or("strobe_line", camera.strobe_line);
  camera.user_set = table.text_or("user_set", camera.user_set);
  read_free_features(table, camera);
}

/// Reads the settings that [camera_defaults] and [[camera]] share. `camera` holds the defaults on
/// entry.
void read_camera_settings(const TomlTable& table, const Studio& studio, StudioCamera& camera) {
  static constexpr std::array<std::pair<std::string_view, CameraKind>, 2> kKinds = {
      {{"aravis", CameraKind::kAravis}, {"v4l2", CameraKind::kV4l2}}};
  static constexpr std::array<std::pair<std::string_view, Edge>, 2> kEdges = {
      {{"rising", Edge::kRising}, {"falling", Edge::kFalling}}};
  if (table.has("node")) {
    camera.node = read_node(table, studio);
  }
  camera.kind = choice(table, "kind", kKinds[static_cast<size_t>(camera.kind)].first, kKinds);
  camera.pixel_format = read_pixel_format(table, camera);
  camera.chroma_key = read_chroma_key(table, camera.chroma_key);
  camera.exposure_us = ranged(table, "exposure_us", camera.exposure_us, 1, 1e6);
  camera.gain_db = ranged(table, "gain_db", camera.gain_db, 0, 60);
  camera.trigger_line = table.text_or("trigger_line", camera.trigger_line);
  camera.trigger_edge =
      choice(table, "trigger_edge", kEdges[static_cast<size_t>(camera.trigger_edge)].first, kEdges);
  camera.packet_size = ranged_int(table, "packet_size", camera.packet_size, 576, 65507);
  camera.packet_delay_ns =
      ranged_int(table, "packet_delay_ns", camera.packet_delay_ns, 0, 1'000'000'000);
  camera.packet_resend = table.boolean_or("packet_resend", camera.packet_resend);
  camera.buffers = ranged_int(table, "buffers", camera.buffers, 2, 1024);
  camera.packet_socket = table.boolean_or("packet_socket", camera.packet_socket);
  camera.ptp = table.boolean_or("ptp", camera.ptp);
  camera.chunk_data = table.boolean_or("chunk_data", camera.chunk_data);
  read_region(table, camera);
  read_features(table, camera);
  read_v4l2_settings(table, camera);
}

constexpr std::array kOnlyAravis = {
    "trigger_line",  "trigger_edge",  "packet_size", "packet_delay_ns",
    "packet_resend", "packet_socket", "ptp",         "chunk_data"};
constexpr std::array kOnlyV4l2 = {"trigger_control", "trigger_value"};

void reject_fields(const TomlTable& table, std::span<const char* const> fields, const char* why) {
  for (const char* const field : fields) {
    if (table.has(field)) table.fail(field, why);
  }
}

/// Rejects settings that a camera of this kind does not have. [camera_defaults] may have settings
/// of both kinds.
void check_fields_of_kind(const TomlTable& table, const StudioCamera& camera) {
  if (camera.kind != CameraKind::kV4l2) {
    return reject_fields(table, kOnlyV4l2, "only a V4L2 camera has this setting; leave it out");
  }
  reject_fields(table, kOnlyAravis, "a V4L2 camera has no such setting; leave it out");
  const std::pair<const char*, bool> used[] = {{"offset_x", camera.offset_x != 0},
                                               {"offset_y", camera.offset_y != 0},
                                               {"binning", camera.binning != 1},
                                               {"reverse_x", camera.reverse_x},
                                               {"reverse_y", camera.reverse_y},
                                               {"black_level", camera.black_level.has_value()},
                                               {"strobe_line", !camera.strobe_line.empty()},
                                               {"user_set", !camera.user_set.empty()}};
  for (const auto& [field, is_used] : used) {
    if (!is_used) continue;
    table.fail(field, "a V4L2 camera has no such setting; expected a control in [camera.features]");
  }
}

/// Checks the combination of defaults and own settings of a camera.
void check_consistency(const TomlTable& table, const StudioCamera& camera) {
  if (camera.node.empty()) {
    table.fail("node", "missing: name the [[node]] here or in [camera_defaults]");
  }
  check_fields_of_kind(table, camera);
  if (camera.kind == CameraKind::kV4l2 && camera.gain_db != 0) {
    table.fail("gain_db",
               "a V4L2 gain has no unit; expected 0, and a control in [camera.features]");
  }
  if ((camera.offset_x != 0 || camera.offset_y != 0) && !camera.size) {
    table.fail(camera.offset_x != 0 ? "offset_x" : "offset_y",
               "expected width and height of the region, too");
  }
  const CameraFormat format = camera.pixel_format;
  const bool is_v4l2 = camera.kind == CameraKind::kV4l2;
  if (!(is_v4l2 ? fourcc_of(format) : pfnc_code(format))) {
    table.fail("pixel_format", std::string(is_v4l2 ? "V4L2" : "GenICam") + " has no " +
                                   std::string(name(format)) + "; expected one of " +
                                   formats_of(camera.kind));
  }
  const bool has_colour = is_bayer(format.image) || format.image == PixelFormat::kRGB8;
  if (camera.chroma_key != ChromaKey::kNone && !has_colour) {
    table.fail("chroma_key", "a " + std::string(name(format)) +
                                 " picture has no colour; expected none, or a pixel_format with "
                                 "colour");
  }
}

}  // namespace

void read_cameras(const TomlTable& file, Studio& studio) {
  StudioCamera defaults;
  if (file.has("camera_defaults")) {
    const TomlTable table = file.table("camera_defaults");
    read_camera_settings(table, studio, defaults);
    table.reject_unknown_fields();
  }
  for (const TomlTable& table : file.tables("camera")) {
    StudioCamera camera = defaults;
    camera.name = read_name(table);
    if (!is_camera_name(camera.name)) {
      table.fail("name", "'" + camera.name +
                             "' is not a valid camera name: " + std::string(kCameraNameRule));
    }
    const auto same_name = [&](const StudioCamera& c) { return c.name == camera.name; };
    if (std::any_of(studio.cameras.begin(), studio.cameras.end(), same_name)) {
      table.fail("name", "two cameras are named '" + camera.name + "'");
    }
    camera.address = table.text("address");
    read_camera_settings(table, studio, camera);
    table.reject_unknown_fields();
    check_consistency(table, camera);
    studio.cameras.push_back(std::move(camera));
  }
  if (studio.cameras.empty()) {
    file.fail("camera", "missing: expected one [[camera]] per camera");
  }
}

}  // namespace v3d
