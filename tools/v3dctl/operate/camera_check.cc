#include "v3dctl/operate/camera_check.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/units.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;
using Grade = CameraVerdict::Grade;

// What is still well; beyond the second a take would be spoilt.
constexpr double kFewClipped = 0.01, kManyClipped = 0.10;
constexpr double kFewDark = 0.30, kManyDark = 0.70;
constexpr double kSoft = 0.7, kBlurred = 0.4;  // of the focus when the background was learnt
constexpr double kSomething = 0.005, kLargePart = 0.40;

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, share < 0.0995 ? "%.1f %%" : "%.0f %%", 100 * share);
  return text;
}

const char* word(Grade grade) {
  return grade == Grade::kGood ? "good" : grade == Grade::kLook ? "look" : "bad";
}

/// Gathers what is wrong; the remedy is that of the worst, the first of equals.
class Judgement {
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

Grade when_above(double value, double look, double bad) {
  return value > bad ? Grade::kBad : value > look ? Grade::kLook : Grade::kGood;
}

Grade when(bool bad) { return bad ? Grade::kBad : Grade::kGood; }

void judge_pulses(const CameraSeen& seen, Judgement& judgement) {
  const std::string of = " of " + format_count(seen.pulses) + " pulses";
  if (seen.received == 0) {
    return judgement.add(Grade::kBad, "no frame" + of,
                         "check its trigger cable and trigger_line in the studio file");
  }
  judgement.add(when(seen.missing > 0), count_of(seen.missing, "frame") + " missing" + of,
                "v3dctl doctor " + seen.node + "; check its network cable and packet_delay_ns");
  judgement.add(when(seen.suspect > 0 || seen.duplicate > 0),
                count_of(seen.suspect + seen.duplicate, "frame") + " with a pulse in doubt",
                "check its trigger cable, and that nothing else triggers it");
}

void judge_pictures(const CameraSeen& seen, Judgement& judgement) {
  if (seen.received == 0) return;
  judgement.add(when_above(seen.clipped, kFewClipped, kManyClipped),
                percent(seen.clipped) + " too bright", "a shorter exposure_us, or close the iris");
  judgement.add(when_above(seen.dark, kFewDark, kManyDark), percent(seen.dark) + " black",
                "take the lens cap off, open the iris, or more light, exposure_us or gain_db");
  if (seen.plates_focus && *seen.plates_focus > 0) {
    const double ratio = seen.focus / *seen.plates_focus;
    judgement.add(ratio < kBlurred ? Grade::kBad
                  : ratio < kSoft  ? Grade::kLook
                                   : Grade::kGood,
                  "sharpness " + percent(ratio) + " of what it was with the background",
                  "check its focus; if it or the light was changed: v3dctl background");
  }
  if (!seen.foreground) {
    judgement.add(Grade::kLook, "no background of it", "clear the studio, then v3dctl background");
  } else {
    judgement.add(when_above(*seen.foreground, kSomething, kLargePart),
                  percent(*seen.foreground) + " foreground",
                  "v3dctl background, unless somebody stands there");
  }
}

CameraSeen parse_camera(const Json& entry, const std::string& node, int64_t pulses) {
  const auto if_any = [&](const char* key) -> std::optional<double> {
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
          .plates_focus = if_any("plates_focus"),
          .foreground = if_any("foreground")};
}

/// Throws a Json exception for anything that is not the account of a check.
std::vector<CameraSeen> parse_node(const Json& detail, const std::string& node) {
  std::vector<CameraSeen> cameras;
  const auto pulses = detail.at("pulses").at("commanded").get<int64_t>();
  for (const Json& entry : detail.at("checked")) {
    cameras.push_back(parse_camera(entry, node, pulses));
  }
  for (const Json& entry : detail.at("not_ready")) {
    CameraSeen& seen = cameras.emplace_back();
    seen.node = node;
    seen.camera = entry.get<std::string>();
    seen.ready = false;
  }
  return cameras;
}

Json to_json(const CameraSeen& seen) {
  const CameraVerdict verdict = judge(seen);
  Json json = {{"name", seen.camera},
               {"node", seen.node},
               {"verdict", word(verdict.grade)},
               {"text", verdict.what},
               {"remedy", verdict.remedy}};
  if (!seen.ready) return json;
  const auto if_any = [](const auto& value) { return value ? Json(*value) : Json(); };
  json.update({{"pulses", seen.pulses},
               {"received", seen.received},
               {"missing", seen.missing},
               {"duplicate", seen.duplicate},
               {"suspect", seen.suspect},
               {"clipped", seen.clipped},
               {"dark", seen.dark},
               {"focus", seen.focus},
               {"plates_focus", if_any(seen.plates_focus)},
               {"foreground", if_any(seen.foreground)}});
  return json;
}

}  // namespace

CheckFindings read_check(const Answer& answer) {
  CheckFindings findings;
  for (const auto& [node, reply] : answer.replies) {
    if (reply.detail.empty()) continue;  // a reconstruction
    try {
      const auto cameras = parse_node(Json::parse(reply.detail), node);
      findings.cameras.insert(findings.cameras.end(), cameras.begin(), cameras.end());
    } catch (const Json::exception&) {
      findings.unreadable.push_back(node);
    }
  }
  return findings;
}

CameraVerdict judge(const CameraSeen& seen) {
  Judgement judgement;
  if (!seen.ready) {
    judgement.add(Grade::kBad, "not ready", "v3dctl status says why; v3dctl doctor " + seen.node);
    return judgement.verdict();
  }
  judge_pulses(seen, judgement);
  judge_pictures(seen, judgement);
  return judgement.verdict();
}

std::vector<std::string> check_lines(const std::vector<CameraSeen>& cameras) {
  std::vector<std::string> lines;
  for (const CameraSeen& seen : cameras) {
    const CameraVerdict verdict = judge(seen);
    char head[96];
    std::snprintf(head, sizeof head, "%-5s %-10s ", word(verdict.grade), seen.camera.c_str());
    std::string line = head;
    if (seen.ready) {
      line += format_count(seen.received) + "/" + format_count(seen.pulses) + " frames   ";
    }
    line += verdict.what;
    if (!verdict.remedy.empty()) line += ". Try: " + verdict.remedy;
    lines.push_back(line);
  }
  return lines;
}

nlohmann::ordered_json check_json(const CheckFindings& findings) {
  Json cameras = Json::array();
  for (const CameraSeen& seen : findings.cameras) cameras.push_back(to_json(seen));
  return {{"good", all_good(findings)}, {"cameras", cameras}, {"unreadable", findings.unreadable}};
}

bool all_good(const CheckFindings& findings) {
  return findings.unreadable.empty() &&
         std::none_of(findings.cameras.begin(), findings.cameras.end(),
                      [](const CameraSeen& seen) { return judge(seen).grade == Grade::kBad; });
}

}  // namespace v3d::ctl
