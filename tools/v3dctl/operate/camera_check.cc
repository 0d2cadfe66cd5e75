#include "v3dctl/operate/camera_check.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/units.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;
using Grade = CameraVerdict::Grade;

// Limits of the grades "look" and "bad", as shares.
constexpr double kLookClipped = 0.01, kBadClipped = 0.10;
constexpr double kLookDark = 0.30, kBadDark = 0.70;
constexpr double kLookFocus = 0.7, kBadFocus = 0.4;  // of the focus of the background plates
constexpr double kLookForeground = 0.005, kBadForeground = 0.40;

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, share < 0.0995 ? "%.1f %%" : "%.0f %%", 100 * share);
  return text;
}

const char* grade_name(Grade grade) {
  return grade == Grade::kGood ? "good" : grade == Grade::kLook ? "look" : "bad";
}

/// Joins the faults. The remedy is that of the worst fault, of the first among equals.
class VerdictBuilder {
 public:
  void add(Grade grade, const std::string& what, const std::string& remedy) {
    if (grade == Grade::kGood) return;
    verdict_.what += (verdict_.what.empty() ? "" : "; ") + what;
    if (grade > verdict_.grade) {
      verdict_.grade = grade;
      verdict_.remedy = remedy;
    }
  }
  CameraVerdict verdict() const {
    CameraVerdict verdict = verdict_;
    if (verdict.what.empty()) verdict.what = "all well";
    return verdict;
  }

 private:
  CameraVerdict verdict_;
};

Grade grade_above(double value, double look, double bad) {
  return value > bad ? Grade::kBad : value > look ? Grade::kLook : Grade::kGood;
}

Grade bad_if(bool bad) { return bad ? Grade::kBad : Grade::kGood; }

void judge_pulses(const CameraMeasurement& camera, VerdictBuilder& builder) {
  const std::string of = " of " + format_count(camera.pulses) + " pulses";
  if (camera.received == 0) {
    return builder.add(Grade::kBad, "no frame" + of,
                       "check its trigger cable and trigger_line in the studio file");
  }
  builder.add(bad_if(camera.missing > 0), count_of(camera.missing, "frame") + " missing" + of,
              "v3dctl doctor " + camera.node + "; check its network cable and packet_delay_ns");
  builder.add(bad_if(camera.suspect > 0 || camera.duplicate > 0),
              count_of(camera.suspect + camera.duplicate, "frame") + " with a pulse in doubt",
              "check its trigger cable, and that nothing else triggers it");
}

void judge_images(const CameraMeasurement& camera, VerdictBuilder& builder) {
  if (camera.received == 0) return;
  builder.add(grade_above(camera.clipped, kLookClipped, kBadClipped),
              percent(camera.clipped) + " too bright", "reduce exposure_us, or close the iris");
  builder.add(grade_above(camera.dark, kLookDark, kBadDark), percent(camera.dark) + " black",
              "take the lens cap off, open the iris, or increase light, exposure_us or gain_db");
  if (camera.plates_focus && *camera.plates_focus > 0) {
    const double ratio = camera.focus / *camera.plates_focus;
    builder.add(ratio < kBadFocus    ? Grade::kBad
                : ratio < kLookFocus ? Grade::kLook
                                     : Grade::kGood,
                "sharpness " + percent(ratio) + " of that of the background",
                "check its focus; after a change of focus or light: v3dctl background");
  }
  if (!camera.foreground) {
    builder.add(Grade::kLook, "no background model", "clear the studio, then v3dctl background");
  } else {
    builder.add(grade_above(*camera.foreground, kLookForeground, kBadForeground),
                percent(*camera.foreground) + " foreground",
                "v3dctl background, unless a person is in the image");
  }
}

CameraMeasurement parse_measurement(const Json& entry, const std::string& node, int64_t pulses) {
  const auto optional_value = [&](const char* key) -> std::optional<double> {
    if (entry.at(key).is_null()) return std::nullopt;
    return entry.at(key).get<double>();
  };
  return {.node = node,
          .camera = entry.at("name").get<std::string>(),
          .pulses = pulses,
          .received = entry.at("received").get<int64_t>(),
          .missing = static_cast<int64_t>(entry.at("missing").size()),
          .duplicate = static_cast<int64_t>(entry.at("duplicate").size()),
          .suspect = static_cast<int64_t>(entry.at("suspect").size()),
          .clipped = entry.at("clipped").get<double>(),
          .dark = entry.at("dark").get<double>(),
          .focus = entry.at("focus").get<double>(),
          .plates_focus = optional_value("plates_focus"),
          .foreground = optional_value("foreground")};
}

/// Throws a Json exception if the detail is no result of a check.
std::vector<CameraMeasurement> parse_node(const Json& detail, const std::string& node) {
  std::vector<CameraMeasurement> cameras;
  const auto pulses = detail.at("pulses").at("commanded").get<int64_t>();
  for (const Json& entry : detail.at("checked")) {
    cameras.push_back(parse_measurement(entry, node, pulses));
  }
  for (const Json& entry : detail.at("not_ready")) {
    CameraMeasurement& camera = cameras.emplace_back();
    camera.node = node;
    camera.camera = entry.get<std::string>();
    camera.ready = false;
  }
  return cameras;
}

Json to_json(const CameraMeasurement& camera) {
  const CameraVerdict verdict = judge(camera);
  Json json = {{"name", camera.camera},
               {"node", camera.node},
               {"verdict", grade_name(verdict.grade)},
               {"text", verdict.what},
               {"remedy", verdict.remedy}};
  if (!camera.ready) return json;
  const auto optional_value = [](const auto& value) { return value ? Json(*value) : Json(); };
  json.update({{"pulses", camera.pulses},
               {"received", camera.received},
               {"missing", camera.missing},
               {"duplicate", camera.duplicate},
               {"suspect", camera.suspect},
               {"clipped", camera.clipped},
               {"dark", camera.dark},
               {"focus", camera.focus},
               {"plates_focus", optional_value(camera.plates_focus)},
               {"foreground", optional_value(camera.foreground)}});
  return json;
}

}  // namespace

CheckReport parse_check_replies(const Answer& answer) {
  CheckReport report;
  for (const auto& [node, reply] : answer.replies) {
    if (reply.detail.empty()) continue;  // of a reconstruction node
    try {
      const auto cameras = parse_node(Json::parse(reply.detail), node);
      report.cameras.insert(report.cameras.end(), cameras.begin(), cameras.end());
    } catch (const Json::exception&) {
      report.unreadable.push_back(node);
    }
  }
  return report;
}

CameraVerdict judge(const CameraMeasurement& camera) {
  VerdictBuilder builder;
  if (!camera.ready) {
    builder.add(Grade::kBad, "not ready",
                "v3dctl status has the reason; v3dctl doctor " + camera.node);
    return builder.verdict();
  }
  judge_pulses(camera, builder);
  judge_images(camera, builder);
  return builder.verdict();
}

std::vector<std::string> check_lines(const std::vector<CameraMeasurement>& cameras) {
  std::vector<std::string> lines;
  for (const CameraMeasurement& camera : cameras) {
    const CameraVerdict verdict = judge(camera);
    char head[96];
    std::snprintf(head, sizeof head, "%-5s %-10s ", grade_name(verdict.grade),
                  camera.camera.c_str());
    std::string line = head;
    if (camera.ready) {
      line += format_count(camera.received) + "/" + format_count(camera.pulses) + " frames   ";
    }
    line += verdict.what;
    if (!verdict.remedy.empty()) line += ". Try: " + verdict.remedy;
    lines.push_back(line);
  }
  return lines;
}

nlohmann::ordered_json check_json(const CheckReport& report) {
  Json cameras = Json::array();
  for (const CameraMeasurement& camera : report.cameras) cameras.push_back(to_json(camera));
  return {{"good", all_good(report)}, {"cameras", cameras}, {"unreadable", report.unreadable}};
}

bool all_good(const CheckReport& report) {
  return report.unreadable.empty() && std::none_of(report.cameras.begin(), report.cameras.end(),
                                                   [](const CameraMeasurement& camera) {
                                                     return judge(camera).grade == Grade::kBad;
                                                   });
}

}  // namespace v3d::ctl
