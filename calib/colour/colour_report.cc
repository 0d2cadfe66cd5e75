#include "calib/colour/colour_report.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/core/html.h"
#include "calib/formatted.h"

namespace v3d::calib {
namespace {

constexpr int kMaxPlaces = 24;  // in the page

std::string colour_table(const std::vector<std::string>& cameras, const ColourFit& fit) {
  std::string html =
      "<table><tr><th>camera</th><th>&Delta;E before</th><th>after</th><th>places</th>"
      "<th>black level</th><th>gain of R</th><th>G</th><th>B</th></tr>\n";
  for (size_t i = 0; i < cameras.size(); ++i) {
    const ColourDifference& d = fit.differences[i];
    const ColourResponse& r = fit.responses[i];
    html += "<tr><td>" + html_escaped(cameras[i]) +
            formatted("</td><td>%.2f</td><td>%.2f</td><td>%d</td><td>%.1f %.1f %.1f</td>", d.before,
                      d.after, d.places, r.black[0], r.black[1], r.black[2]) +
            formatted("<td>%.3f</td><td>%.3f</td><td>%.3f</td></tr>\n", r.matrix.row(0).sum(),
                      r.matrix.row(1).sum(), r.matrix.row(2).sum());
  }
  return html + "</table>\n";
}

/// The sRGB value of a linear grey value.
int srgb_of(double grey) {
  const double v = std::clamp(grey / 255, 0.0, 1.0);
  const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<int>(std::lround(255 * s));
}

std::string square(double x, double y, const Eigen::Vector3d& grey) {
  return formatted(
      "<rect x=\"%.0f\" y=\"%.0f\" width=\"22\" height=\"22\" fill=\"rgb(%d,%d,%d)\"/>\n", x, y,
      srgb_of(grey[0]), srgb_of(grey[1]), srgb_of(grey[2]));
}

/// Colour squares: columns are the places with most samples, rows are cameras.
std::string squares(const std::vector<std::string>& cameras, const ColourFit& fit,
                    std::span<const ColourSample> samples, bool after) {
  std::map<int, int> seen;
  for (const ColourSample& sample : samples) ++seen[sample.place];
  std::vector<std::pair<int, int>> order;
  for (const auto& [place, count] : seen) order.emplace_back(-count, place);
  std::ranges::sort(order);
  order.resize(std::min<size_t>(order.size(), kMaxPlaces));
  std::map<int, int> column;
  for (const auto& [count, place] : order) column.emplace(place, static_cast<int>(column.size()));
  const auto rows = static_cast<double>(cameras.size());
  std::string svg = formatted("<svg width=\"680\" height=\"%.0f\">\n", 24 * rows);
  for (const ColourSample& sample : samples) {
    const auto place = column.find(sample.place);
    if (place == column.end()) continue;
    const Eigen::Vector3d grey =
        after ? fit.responses[sample.camera].corrected(sample.grey) : sample.grey;
    svg += square(90 + 24.0 * place->second, 24.0 * sample.camera, grey);
  }
  for (size_t i = 0; i < cameras.size(); ++i) {
    svg += formatted("<text x=\"2\" y=\"%.0f\">", 24.0 * static_cast<double>(i) + 16) +
           html_escaped(cameras[i]) + "</text>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace

std::string colour_report_html(const std::vector<std::string>& cameras, const ColourFit& fit,
                               std::span<const ColourSample> samples) {
  return html_head("Colours") + formatted("<h1>Colours of %zu cameras</h1>\n<p>", cameras.size()) +
         formatted(
             "Difference between each camera's colours and those of the others at the same places: "
             "&Delta;E (CIE 2000) %.2f before, %.2f after (median); 90th percentile %.2f, "
             "%.2f.</p>\n",
             fit.overall.before, fit.overall.after, fit.ninety_percent.before,
             fit.ninety_percent.after) +
         colour_table(cameras, fit) + "<h2>Before</h2>\n" + squares(cameras, fit, samples, false) +
         "<h2>After</h2>\n" + squares(cameras, fit, samples, true) +
         "<p>Columns are places, rows are cameras.</p>\n</body></html>\n";
}

}  // namespace v3d::calib
