#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "base/config/toml_file.h"
#include "capture/cameras/aravis_device.h"

namespace v3d::capture::aravis {
namespace {

std::optional<double> as_number(const std::string& text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(number) : std::nullopt;
}

const char* text_of(bool value) { return value ? "true" : "false"; }

}  // namespace

void write_integer(const StudioCamera& settings, ArvCamera* camera, const std::string& feature,
                   int64_t wanted) {
  Problem set;
  arv_camera_set_integer(camera, feature.c_str(), wanted, set);
  if (set.happened()) fail(settings, feature, std::to_string(wanted), set.text());
  ArvGcNode* const node = arv_device_get_feature(arv_camera_get_device(camera), feature.c_str());
  if (arv_gc_feature_node_get_actual_access_mode(ARV_GC_FEATURE_NODE(node)) ==
      ARV_GC_ACCESS_MODE_WO) {
    return;
  }
  Problem get;
  const gint64 got = arv_camera_get_integer(camera, feature.c_str(), get);
  if (get.happened() || got != wanted) {
    fail(settings, feature, std::to_string(wanted),
         get.happened() ? get.text() : std::to_string(got));
  }
}

bool is_same_value(const std::string& asked, const std::string& got) {
  if (asked == got) return true;
  constexpr double kPrinted = 1e-5;
  const auto a = as_number(asked);
  const auto b = as_number(got);
  return a && b && std::abs(*a - *b) <= kPrinted * std::max(1.0, std::abs(*a));
}

void FeatureWriter::write(const std::string& feature, const std::string& value) {
  ArvGcNode* const node = arv_device_get_feature(arv_camera_get_device(camera_), feature.c_str());
  if (!ARV_IS_GC_FEATURE_NODE(node)) {
    fail(settings_, feature, value, "a camera without this feature");
  }
  Problem set;
  if (ARV_IS_GC_COMMAND(node)) {
    if (value == "true") arv_gc_command_execute(ARV_GC_COMMAND(node), set);
    if (set.happened()) differences_.push_back({feature, value, set.text()});
    return;
  }
  ArvGcFeatureNode* const target = ARV_GC_FEATURE_NODE(node);
  arv_gc_feature_node_set_value_from_string(target, value.c_str(), set);
  Problem get;
  const char* const got = arv_gc_feature_node_get_value_as_string(target, get);
  if (get.happened() || !got) {
    differences_.push_back({feature, value, get.text()});
  } else if (!is_same_value(value, got)) {
    differences_.push_back({feature, value, got});
  }
}

void FeatureWriter::write_if_supported(const std::string& feature, const std::string& value) {
  if (has_feature(camera_, feature.c_str())) write(feature, value);
}

void FeatureWriter::add_difference(const std::string& feature, const std::string& asked,
                                   const std::string& got) {
  differences_.push_back({feature, asked, got});
}

void FeatureWriter::add_rounded(const std::string& feature, const std::string& asked,
                                const std::string& got) {
  differences_.push_back({feature, asked, got, true});
}

void load_user_set(const StudioCamera& settings, FeatureWriter& writer) {
  if (settings.user_set.empty()) return;
  writer.write("UserSetSelector", settings.user_set);
  writer.write("UserSetLoad", "true");
}

/// A camera accepts an offset only where the region then fits on the sensor, so the offsets are 0
/// while the size changes. Binning changes the largest size.
void write_region(const StudioCamera& settings, ArvCamera* camera, FeatureWriter& writer) {
  writer.write_if_supported("BinningHorizontal", std::to_string(settings.binning));
  writer.write_if_supported("BinningVertical", std::to_string(settings.binning));
  if (settings.size) {
    writer.write_if_supported("OffsetX", "0");
    writer.write_if_supported("OffsetY", "0");
    write_integer(settings, camera, "Width", settings.size->width);
    write_integer(settings, camera, "Height", settings.size->height);
    write_integer(settings, camera, "OffsetX", settings.offset_x);
    write_integer(settings, camera, "OffsetY", settings.offset_y);
  }
  writer.write_if_supported("ReverseX", text_of(settings.reverse_x));
  writer.write_if_supported("ReverseY", text_of(settings.reverse_y));
}

void switch_automatic_off(FeatureWriter& writer) {
  for (const char* feature : {"ExposureAuto", "GainAuto", "BalanceWhiteAuto", "BlackLevelAuto"}) {
    writer.write_if_supported(feature, "Off");
  }
  writer.write_if_supported("GammaEnable", "false");
  writer.write_if_supported("Gamma", "1");
}

void write_features(const StudioCamera& settings, FeatureWriter& writer) {
  if (settings.black_level) writer.write("BlackLevel", toml_number(*settings.black_level));
  if (!settings.strobe_line.empty()) {
    writer.write("LineSelector", settings.strobe_line);
    writer.write_if_supported("LineMode", "Output");
    writer.write("LineSource", "ExposureActive");
  }
  for (const CameraFeature& feature : settings.features) {
    writer.write(feature.name, feature.value);
  }
}

}  // namespace v3d::capture::aravis
