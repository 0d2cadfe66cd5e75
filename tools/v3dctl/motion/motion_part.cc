#include "v3dctl/motion/motion_part.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/core/statistics.h"
#include "recon/pipeline/compact_frame.h"

namespace v3d::ctl {
namespace {

using Json = nlohmann::ordered_json;

template <class Value>
double median_of(const std::vector<recon::PulseResidual>& residuals,
                 Value recon::PulseResidual::*value) {
  std::vector<double> values;
  for (const recon::PulseResidual& residual : residuals) {
    values.push_back(static_cast<double>(residual.*value));
  }
  return median(values);
}

TrackedSegmentReport report_of(const recon::TrackedSegment& segment) {
  constexpr double kMillimetres = 1000;
  TrackedSegmentReport report;
  report.first = segment.pulses.front();
  report.pulses = std::ssize(segment.pulses) - (segment.shares_last ? 1 : 0);
  report.last = segment.pulses[static_cast<size_t>(report.pulses) - 1];
  report.key = segment.pulses[segment.key];
  report.vertices = std::ssize(segment.surface.vertices);
  report.triangles = std::ssize(segment.surface.triangles);
  report.residual_p50_mm =
      kMillimetres * median_of(segment.residuals, &recon::PulseResidual::median_m);
  report.residual_p90_mm =
      kMillimetres * median_of(segment.residuals, &recon::PulseResidual::p90_m);
  for (size_t i = 0; i < static_cast<size_t>(report.pulses); ++i) {
    const recon::PulseResidual& residual = segment.residuals[i];
    report.far = std::max({report.far, residual.far, residual.surplus});
    report.residuals.emplace_back(segment.pulses[i], residual);
  }
  report.patch_correlation = median_of(segment.residuals, &recon::PulseResidual::correlation);
  report.matched_patches =
      static_cast<int64_t>(median_of(segment.residuals, &recon::PulseResidual::matched_patches));
  return report;
}

using ColourRow = std::vector<codec::VertexColour>;  ///< of the vertices at a pulse

/// Replaces empty rows by the nearest row with colours, the earlier one of two. Requires one.
void fill_from_nearest(std::vector<ColourRow>& rows) {
  std::vector<size_t> known;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].empty()) known.push_back(i);
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].empty()) continue;
    const auto distance = [i](size_t k) { return k > i ? k - i : i - k; };
    rows[i] = rows[*std::ranges::min_element(known, {}, distance)];
  }
}

/// The colours of the pulses; `without` gets the pulses of content_of() without images.
std::vector<ColourRow> colours_of(const recon::TrackedSegment& segment,
                                  std::vector<int64_t>& without) {
  std::vector<ColourRow> rows;
  std::vector<int64_t> empty;
  for (size_t i = 0; i < segment.pulses.size(); ++i) {
    rows.push_back(recon::vertex_colours(segment.colours[i]));
    const bool is_in_next = segment.shares_last && i + 1 == segment.pulses.size();
    if (rows.back().empty() && !is_in_next) empty.push_back(segment.pulses[i]);
  }
  if (std::ranges::any_of(rows, [](const ColourRow& row) { return !row.empty(); })) {
    fill_from_nearest(rows);
    without = std::move(empty);
    return rows;
  }
  if (segment.surface.colours.empty()) return {};
  return {recon::vertex_colours(segment.surface.colours)};
}

Json residual_to_json(const std::pair<int64_t, recon::PulseResidual>& of_pulse) {
  const auto& [pulse, residual] = of_pulse;
  return {pulse,
          residual.median_m,
          residual.p90_m,
          residual.far,
          residual.surplus,
          residual.silhouette_iou,
          residual.matched_patches,
          residual.correlation};
}

/// JSON has no infinite numbers.
double number_of(const Json& json) {
  return json.is_null() ? std::numeric_limits<double>::infinity() : json.get<double>();
}

std::pair<int64_t, recon::PulseResidual> residual_from_json(const Json& json) {
  recon::PulseResidual residual;
  residual.median_m = number_of(json.at(1));
  residual.p90_m = number_of(json.at(2));
  residual.far = number_of(json.at(3));
  residual.surplus = number_of(json.at(4));
  residual.silhouette_iou = number_of(json.at(5));
  residual.matched_patches = json.at(6);
  residual.correlation = number_of(json.at(7));
  return {json.at(0).get<int64_t>(), residual};
}

Json report_to_json(const TrackedSegmentReport& report) {
  Json residuals = Json::array();
  for (const auto& residual : report.residuals) residuals.push_back(residual_to_json(residual));
  return {{"first", report.first},
          {"last", report.last},
          {"key", report.key},
          {"pulses", report.pulses},
          {"vertices", report.vertices},
          {"triangles", report.triangles},
          {"residual_p50_mm", report.residual_p50_mm},
          {"residual_p90_mm", report.residual_p90_mm},
          {"far", report.far},
          {"matched_patches", report.matched_patches},
          {"patch_correlation", report.patch_correlation},
          {"residuals", residuals}};
}

TrackedSegmentReport report_from_json(const Json& json) {
  TrackedSegmentReport report;
  report.first = json.at("first");
  report.last = json.at("last");
  report.key = json.at("key");
  report.pulses = json.at("pulses");
  report.vertices = json.at("vertices");
  report.triangles = json.at("triangles");
  report.residual_p50_mm = number_of(json.at("residual_p50_mm"));
  report.residual_p90_mm = number_of(json.at("residual_p90_mm"));
  report.far = number_of(json.at("far"));
  report.matched_patches = json.at("matched_patches");
  report.patch_correlation = number_of(json.at("patch_correlation"));
  for (const Json& residual : json.at("residuals")) {
    report.residuals.push_back(residual_from_json(residual));
  }
  return report;
}

}  // namespace

MotionContent content_of(const recon::TrackedSegment& segment) {
  MotionContent content{recon::motion_segment(segment), {}};
  content.motion.colours = colours_of(segment, content.without_images);
  return content;
}

MotionPart part_of(const recon::TrackedSegment& segment, const codec::EncodedMotion& encoded,
                   std::vector<int64_t> without_images) {
  MotionPart part;
  part.pulses = segment.pulses;
  part.bytes.assign(encoded.bytes.begin(), encoded.bytes.end());
  const codec::MotionBytes& parts = encoded.parts;
  part.template_bytes = static_cast<int64_t>(parts.header + parts.triangles +
                                             parts.template_positions + parts.template_colours);
  part.position_bytes = static_cast<int64_t>(parts.positions);
  part.colour_bytes = static_cast<int64_t>(parts.colours);
  part.confidence_bytes = static_cast<int64_t>(parts.confidences);
  part.report = report_of(segment);
  part.without_images = std::move(without_images);
  return part;
}

MotionPart encoded_part(const recon::TrackedSegment& segment, double step_m) {
  MotionContent content = content_of(segment);
  const auto encoded = codec::encode_motion(content.motion, {.step_m = step_m});
  return part_of(segment, encoded.value_or(codec::EncodedMotion()),
                 std::move(content.without_images));
}

Json part_to_json(const MotionPart& part) {
  return {{"pulses", part.pulses},
          {"template_bytes", part.template_bytes},
          {"position_bytes", part.position_bytes},
          {"colour_bytes", part.colour_bytes},
          {"confidence_bytes", part.confidence_bytes},
          {"report", report_to_json(part.report)},
          {"without_images", part.without_images}};
}

MotionPart part_from_json(const Json& json) {
  MotionPart part;
  part.pulses = json.at("pulses").get<std::vector<int64_t>>();
  part.template_bytes = json.at("template_bytes");
  part.position_bytes = json.at("position_bytes");
  part.colour_bytes = json.at("colour_bytes");
  part.confidence_bytes = json.at("confidence_bytes");
  part.report = report_from_json(json.at("report"));
  part.without_images = json.at("without_images").get<std::vector<int64_t>>();
  return part;
}

}  // namespace v3d::ctl
