#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/core/statistics.h"
#include "v3dctl/options.h"
#include "v3dctl/takes/clap.h"

namespace v3d::ctl {

using Json = nlohmann::ordered_json;

std::optional<double> ClapOffset::picture_pulse() const {
  if (cameras.empty()) return std::nullopt;
  std::vector<double> pulses;
  for (const Camera& camera : cameras) pulses.push_back(camera.pulse);
  return upper_median(pulses);
}

std::string clap_text(const ClapOffset& clap) {
  const std::string text = fmt::format("clap at pulse {:.2f}", clap.sound_pulse);
  if (clap.cameras.empty()) return text + "; no camera shows a motion that stops there";
  const double offset_ms = 1000 * clap.offset_s();
  return fmt::format("{}; the sound is {:.0f} ms {} than the pictures, +-{:.0f} ms, by {}", text,
                     std::abs(offset_ms), offset_ms < 0 ? "earlier" : "later",
                     1000 * clap.uncertainty_s(), count_of(std::ssize(clap.cameras), "camera"));
}

Json clap_json(const std::optional<ClapOffset>& clap) {
  Json json = {{"sound_pulse", nullptr},
               {"picture_pulse", nullptr},
               {"cameras", 0},
               {"offset_ms", nullptr},
               {"uncertainty_ms", nullptr}};
  if (!clap) return json;
  json["sound_pulse"] = clap->sound_pulse;
  json["cameras"] = clap->cameras.size();
  if (clap->cameras.empty()) return json;
  json["picture_pulse"] = *clap->picture_pulse();
  json["offset_ms"] = 1000 * clap->offset_s();
  json["uncertainty_ms"] = 1000 * clap->uncertainty_s();
  return json;
}

}  // namespace v3d::ctl
