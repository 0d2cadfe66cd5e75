#include "v3dctl/operate/camera_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/core/text.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;
using Grade = CameraVerdict::Grade;

// Limits of the grades "look" and "bad", as shares.
constexpr double kLookClipped = 0.01, kBadClipped = 0.10;
constexpr double kLookDark = 0.30, kBadDark = 0.70;
constexpr double kLookFocus = 0.7, kBadFocus = 0.4;  // of the focus of the background plates
constexpr double kLookFlicker = 0.01, kBadFlicker = 0.05;
constexpr double kLookForeground = 0.005, kBadForeground = 0.40;

std::string percent(double share) {
  return fmt::format("{:.{}f} %", 100 * share, share < 0.0995 ? 1 : 0);
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
  const int64_t dropped = std::min(camera.dropped, camera.missing);
  builder.add(bad_if(dropped > 0), count_of(dropped, "frame") + " not examined" + of,
              camera.node + " is too busy; end other programs on it");
  const int64_t missing = camera.missing - dropped;
  builder.add(bad_if(missing > 0), count_of(missing, "frame") + " missing" + of,
              "v3dctl doctor " + camera.node + "; check its network cable and packet_delay_ns");
  builder.add(bad_if(camera.suspect > 0 || camera.duplicate > 0),
              count_of(camera.suspect + camera.duplicate, "frame") + " with a pulse in doubt",
              "check its trigger cable, and that nothing else triggers it");
}

std::string remedy_of_flicker(const CameraMeasurement& camera) {
  const std::string lamps = "lamps without flicker; measure in an empty studio";
  if (!camera.rate_without_flicker_hz) return lamps;
  return fmt::format("rate_hz = {:.6g} under [trigger], or ", *camera.rate_without_flicker_hz) +
         lamps;
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
  if (camera.beat_hz) {
    builder.add(grade_above(camera.flicker_amplitude, kLookFlicker, kBadFlicker),
                fmt::format("light flickers by {} at {:.2g} Hz", percent(camera.flicker_amplitude),
                            *camera.beat_hz),
                remedy_of_flicker(camera));
  }
  if (!camera.foreground) {
    builder.add(Grade::kLook, "no background model", "clear the studio, then v3dctl background");
  } else {
    builder.add(grade_above(*camera.foreground, kLookForeground, kBadForeground),
                percent(*camera.foreground) + " foreground",
                "v3dctl background, unless a person is in the image");
  }
}

std::vector<segmentation::MotionStop> parse_stops(const Json& entry) {
  std::vector<segmentation::MotionStop> stops;
  for (const Json& stop : entry.value("motion_stops", Json::array())) {
    stops.push_back({stop.at(0).get<double>(), stop.at(1).get<double>()});
  }
  return stops;
}

CameraMeasurement parse_measurement(const Json& entry, const std::string& node, int64_t pulses) {
  const auto optional_value = [&](const char* key) -> std::optional<double> {
    const Json value = entry.value(key, Json());
    if (value.is_null()) return std::nullopt;
    return value.get<double>();
  };
  // Earlier nodes send the whole lists and no counts.
  const auto count = [&](const std::string& list) {
    const std::string key = list + "_count";
    return entry.value(key, static_cast<int64_t>(entry.at(list).size()));
  };
  return {.node = node,
          .camera = entry.at("name").get<std::string>(),
          .pulses = pulses,
          .received = entry.at("received").get<int64_t>(),
          .missing = count("missing"),
          .dropped = entry.value("dropped", int64_t{0}),
          .duplicate = count("duplicate"),
          .suspect = count("suspect"),
          .clipped = entry.at("clipped").get<double>(),
          .dark = entry.at("dark").get<double>(),
          .focus = entry.at("focus").get<double>(),
          .plates_focus = optional_value("plates_focus"),
          .foreground = optional_value("foreground"),
          .flicker_amplitude = entry.value("flicker_amplitude", 0.0),
          .beat_hz = optional_value("beat_hz"),
          .rate_without_flicker_hz = optional_value("rate_without_flicker_hz"),
          .motion_stops = parse_stops(entry)};
}

/// Throws a Json exception if the detail is no result of a check.
void parse_node(const Json& detail, const std::string& node, CheckReport& report) {
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
  auto sound = parse_sound(detail, node);
  if (sound) report.sounds.push_back(*std::move(sound));
  std::ranges::move(cameras, std::back_inserter(report.cameras));
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
               {"dropped", camera.dropped},
               {"duplicate", camera.duplicate},
               {"suspect", camera.suspect},
               {"clipped", camera.clipped},
               {"dark", camera.dark},
               {"focus", camera.focus},
               {"plates_focus", optional_value(camera.plates_focus)},
               {"foreground", optional_value(camera.foreground)},
               {"flicker_amplitude", camera.flicker_amplitude},
               {"beat_hz", optional_value(camera.beat_hz)},
               {"rate_without_flicker_hz", optional_value(camera.rate_without_flicker_hz)}});
  return json;
}

}  // namespace

CheckReport parse_check_replies(const control::Answer& answer) {
  CheckReport report;
  for (const auto& [node, reply] : answer.replies) {
    if (reply.detail.empty()) continue;  // of a reconstruction node
    try {
      parse_node(Json::parse(reply.detail), node, report);
    } catch (const Json::exception&) {
      report.unreadable.push_back(node);
    }
  }
  CameraStops stops;
  for (const CameraMeasurement& camera : report.cameras) stops[camera.camera] = camera.motion_stops;
  compare_with_pictures(stops, report.sounds);
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
    std::string line = fmt::format("{:<5} {:<10} ", grade_name(verdict.grade), camera.camera);
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
  return {{"good", all_good(report)},
          {"cameras", cameras},
          {"sounds", sounds_json(report.sounds)},
          {"unreadable", report.unreadable}};
}

bool all_good(const CheckReport& report) {
  return report.unreadable.empty() && std::none_of(report.cameras.begin(), report.cameras.end(),
                                                   [](const CameraMeasurement& camera) {
                                                     return judge(camera).grade == Grade::kBad;
                                                   });
}

namespace {

constexpr int kTitleHeight = 22;
constexpr int kGap = 4;
constexpr int kGlyphWidth = 5;
constexpr int kGlyphHeight = 7;
constexpr int kDot = 2;  // side of a glyph's dot in pixels
constexpr ImageSize kEmptyCell{320, 240};

using Glyph = std::array<uint8_t, kGlyphHeight>;  // rows from the top; the leftmost dot is bit 4

// Bitmaps of the characters. Lower case letters use those of upper case.
constexpr std::string_view kCharacters = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ-_.:/ ";
constexpr std::array<Glyph, kCharacters.size()> kGlyphs = {{
    {14, 17, 19, 21, 25, 17, 14}, {4, 12, 4, 4, 4, 4, 14},      {14, 17, 1, 2, 4, 8, 31},
    {31, 2, 4, 2, 1, 17, 14},     {2, 6, 10, 18, 31, 2, 2},     {31, 16, 30, 1, 1, 17, 14},
    {6, 8, 16, 30, 17, 17, 14},   {31, 1, 2, 4, 8, 8, 8},       {14, 17, 17, 14, 17, 17, 14},
    {14, 17, 17, 15, 1, 2, 12},   {14, 17, 17, 31, 17, 17, 17}, {30, 17, 17, 30, 17, 17, 30},
    {14, 17, 16, 16, 16, 17, 14}, {28, 18, 17, 17, 17, 18, 28}, {31, 16, 16, 30, 16, 16, 31},
    {31, 16, 16, 30, 16, 16, 16}, {14, 17, 16, 23, 17, 17, 15}, {17, 17, 17, 31, 17, 17, 17},
    {14, 4, 4, 4, 4, 4, 14},      {7, 2, 2, 2, 2, 18, 12},      {17, 18, 20, 24, 20, 18, 17},
    {16, 16, 16, 16, 16, 16, 31}, {17, 27, 21, 21, 17, 17, 17}, {17, 17, 25, 21, 19, 17, 17},
    {14, 17, 17, 17, 17, 17, 14}, {30, 17, 17, 30, 16, 16, 16}, {14, 17, 17, 17, 21, 18, 13},
    {30, 17, 17, 30, 20, 18, 17}, {15, 16, 16, 14, 1, 1, 30},   {31, 4, 4, 4, 4, 4, 4},
    {17, 17, 17, 17, 17, 17, 14}, {17, 17, 17, 17, 17, 10, 4},  {17, 17, 17, 21, 21, 21, 10},
    {17, 17, 10, 4, 10, 17, 17},  {17, 17, 17, 10, 4, 4, 4},    {31, 1, 2, 4, 8, 16, 31},
    {0, 0, 0, 31, 0, 0, 0},       {0, 0, 0, 0, 0, 0, 31},       {0, 0, 0, 0, 0, 12, 12},
    {0, 12, 12, 0, 12, 12, 0},    {0, 1, 2, 4, 8, 16, 0},       {0, 0, 0, 0, 0, 0, 0},
}};
constexpr Glyph kUnknown = {31, 17, 17, 17, 17, 17, 31};

const Glyph& glyph_of(char c) {
  const size_t at =
      kCharacters.find(static_cast<char>(std::toupper(static_cast<unsigned char>(c))));
  return at == std::string_view::npos ? kUnknown : kGlyphs[at];
}

using Colour = std::array<uint8_t, 3>;
constexpr Colour kWhite{255, 255, 255};
constexpr Colour kOutline{255, 0, 200};  // rare in skin, clothes and walls
constexpr Colour kNoImage{40, 40, 40};

void put(Image& image, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= image.size.width || y >= image.size.height) return;
  std::copy(colour.begin(), colour.end(), image.row(y) + 3 * x);
}

void fill(Image& image, const Rect& rect, const Colour& colour) {
  for (int y = rect.y0; y < rect.y0 + rect.height; ++y) {
    for (int x = rect.x0; x < rect.x0 + rect.width; ++x) put(image, x, y, colour);
  }
}

void draw_glyph(Image& image, int x, int y, const Glyph& glyph) {
  for (int row = 0; row < kGlyphHeight; ++row) {
    for (int column = 0; column < kGlyphWidth; ++column) {
      if ((glyph[static_cast<size_t>(row)] >> (kGlyphWidth - 1 - column) & 1) == 0) continue;
      fill(image, {x + column * kDot, y + row * kDot, kDot, kDot}, kWhite);
    }
  }
}

void paste(Image& sheet, int x, int y, const Image& image) {
  for (int row = 0; row < image.size.height; ++row) {
    std::copy_n(image.row(row), 3 * image.size.width, sheet.row(y + row) + 3 * x);
  }
}

/// Colours foreground pixels that have a neighbour in the background.
void draw_outline(Image& sheet, int x0, int y0, const Mask& mask) {
  const ImageSize size = mask.size();
  const auto is_inside = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < size.width && y < size.height && mask.get(x, y);
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (!mask.get(x, y)) continue;
      const bool on_outline = !is_inside(x - 1, y) || !is_inside(x + 1, y) ||
                              !is_inside(x, y - 1) || !is_inside(x, y + 1);
      if (on_outline) put(sheet, x0 + x, y0 + y, kOutline);
    }
  }
}

ImageSize cell_of(const std::vector<SheetImage>& images) {
  ImageSize cell{0, 0};
  for (const SheetImage& entry : images) {
    if (!entry.image) continue;
    cell.width = std::max(cell.width, entry.image->size.width);
    cell.height = std::max(cell.height, entry.image->size.height);
  }
  return cell.width > 0 ? cell : kEmptyCell;
}

void draw_cell(Image& sheet, int x, int y, ImageSize cell, const SheetImage& entry) {
  draw_text(sheet, x + kGap, y + kGap, entry.name + (entry.image ? "" : "  NO IMAGE"));
  y += kTitleHeight;
  if (!entry.image) return fill(sheet, {x, y, cell.width, cell.height}, kNoImage);
  paste(sheet, x, y, *entry.image);
  if (entry.mask && entry.mask->size() == entry.image->size) {
    draw_outline(sheet, x, y, *entry.mask);
  }
}

}  // namespace

void draw_text(Image& image, int x, int y, const std::string& text) {
  for (const char c : text) {
    draw_glyph(image, x, y, glyph_of(c));
    x += (kGlyphWidth + 1) * kDot;
  }
}

Image contact_sheet(const std::vector<SheetImage>& images) {
  const auto count = static_cast<int>(images.size());
  const int columns = std::max(1, static_cast<int>(std::ceil(std::sqrt(count))));
  const int rows = std::max(1, (count + columns - 1) / columns);
  const ImageSize cell = cell_of(images);
  const ImageSize pitch{cell.width + kGap, cell.height + kTitleHeight + kGap};
  Image sheet({columns * pitch.width + kGap, rows * pitch.height + kGap}, PixelFormat::kRGB8);
  for (int i = 0; i < count; ++i) {
    draw_cell(sheet, kGap + i % columns * pitch.width, kGap + i / columns * pitch.height, cell,
              images[static_cast<size_t>(i)]);
  }
  return sheet;
}

}  // namespace v3d::ctl
