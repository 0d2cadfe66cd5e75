#include "daemon/node/health_size.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <span>
#include <string_view>

#include "daemon/bus/channel_list.h"
#include "wire/codec.h"

namespace v3d::node {
namespace {

constexpr size_t kMaxProblems = 8;
constexpr size_t kMaxText = 2048;

bool is_of_camera(const std::string& name) { return !wire::split_health_name(name).camera.empty(); }

/// What an operator must see of each camera.
bool is_important(const std::string& name) {
  static const std::set<std::string, std::less<>> kImportant = {"frames", "frames_missing",
                                                                "streaming_flag"};
  return kImportant.contains(wire::split_health_name(name).name);
}

void add_to_text(wire::HealthMessage& health, std::string_view what) {
  health.text += health.text.empty() ? "" : "; ";
  health.text += fmt::format("health has no {} of the cameras: too many for one message", what);
}

}  // namespace

std::string join_camera_problems(const std::vector<std::string>& problems) {
  const size_t shown = std::min(problems.size(), kMaxProblems);
  std::string line = fmt::format("{}", fmt::join(std::span(problems).first(shown), "; "));
  if (shown == problems.size()) return line;
  return line + fmt::format("; and {} more cameras", problems.size() - shown);
}

void shorten_health(wire::HealthMessage& health, size_t max_bytes) {
  const auto fits = [&] { return encode(health).size() <= max_bytes; };
  if (fits()) return;
  health.text = bus::shortened(health.text, kMaxText);
  if (fits()) return;
  const std::string text = health.text;
  std::erase_if(health.texts, [](const auto& entry) { return is_of_camera(entry.first); });
  add_to_text(health, "model and firmware");
  if (fits()) return;
  health.text = text;
  std::erase_if(health.values, [](const auto& entry) {
    return is_of_camera(entry.first) && !is_important(entry.first);
  });
  add_to_text(health, "detailed values");
  if (fits()) return;
  health.text = text;
  std::erase_if(health.values, [](const auto& entry) { return is_of_camera(entry.first); });
  add_to_text(health, "values");
}

}  // namespace v3d::node
