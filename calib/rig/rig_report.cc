#include "calib/rig/rig_report.h"

#include <algorithm>
#include <cmath>

#include "base/html.h"
#include "calib/boards/view_selection.h"
#include "calib/formatted.h"
#include "calib/rig/advice.h"

namespace v3d::calib {
namespace {

constexpr int kMostArrows = 600;  // of a camera: more is a smear, and a heavy file

std::string table(const RigFit& fit) {
  std::string html =
      "<table><tr><th>camera</th><th>RMS, px</th><th>views</th><th>left out</th>"
      "<th>image reached</th><th>coefficients</th><th>late, pictures</th></tr>\n";
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const CameraFit& c = fit.cameras[i];
    html += "<tr><td>" + html_escaped(fit.rig[i].name) +
            print("</td><td>%.2f</td><td>%d</td><td>%d</td><td>%.0f %%</td><td>%s</td>", c.rms_px,
                  c.views, c.rejected, 100 * c.coverage,
                  c.coefficients ? std::to_string(c.coefficients).c_str() : "as before") +
            print("<td>%.2f</td></tr>\n", c.late);
  }
  return html + "</table>\n";
}

std::string weak_points(const RigFit& fit) {
  const std::vector<std::string> weak = advice(fit);
  if (weak.empty()) return "<p>Nothing is weak.</p>\n";
  std::string html = "<ul>\n";
  for (const std::string& sentence : weak) html += "<li>" + html_escaped(sentence) + "</li>\n";
  return html + "</ul>\n";
}

/// The rig from above, fitted into a square.
class Map {
 public:
  explicit Map(const Rig& rig) {
    for (const RigCamera& camera : rig) {
      const Eigen::Vector2d at = camera.model.center().head<2>();
      low_ = low_.cwiseMin(at);
      high_ = high_.cwiseMax(at);
    }
  }
  Eigen::Vector2d operator()(const Eigen::Vector3d& world) const {
    const double scale = (kSide - 2 * kMargin) / std::max(1e-6, (high_ - low_).maxCoeff());
    const Eigen::Vector2d p = scale * (world.head<2>() - 0.5 * (low_ + high_));
    return {kSide / 2 + p.x(), kSide / 2 - p.y()};
  }
  static constexpr double kSide = 560;

 private:
  static constexpr double kMargin = 60;
  Eigen::Vector2d low_ = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high_ = Eigen::Vector2d::Constant(-1e300);
};

bool in_tree(const RigTree& tree, const PairPose& pair) {
  return std::any_of(tree.edges.begin(), tree.edges.end(), [&](const TreeEdge& e) {
    return (e.from == pair.a && e.to == pair.b) || (e.from == pair.b && e.to == pair.a);
  });
}

std::string shared_views(const RigFit& fit) {
  const Map map(fit.rig);
  std::string svg = print("<svg width=\"%.0f\" height=\"%.0f\">\n", Map::kSide, Map::kSide);
  int most = 1;
  for (const PairPose& pair : fit.pairs) most = std::max(most, pair.agreeing);
  for (const PairPose& pair : fit.pairs) {
    if (pair.agreeing == 0) continue;
    const Eigen::Vector2d a = map(fit.rig[pair.a].model.center());
    const Eigen::Vector2d b = map(fit.rig[pair.b].model.center());
    svg += print(
               "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\" "
               "stroke-width=\"%.1f\"><title>",
               a.x(), a.y(), b.x(), b.y(), in_tree(fit.tree, pair) ? "#d2691e" : "#9ab",
               0.5 + 6.0 * pair.agreeing / most) +
           html_escaped(fit.rig[pair.a].name) + " and " + html_escaped(fit.rig[pair.b].name) +
           print(": %d shared views, %d agree</title></line>\n", pair.shared, pair.agreeing);
  }
  for (const RigCamera& camera : fit.rig) {
    const Eigen::Vector2d at = map(camera.model.center());
    svg += print("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\"/><text x=\"%.1f\" y=\"%.1f\">", at.x(),
                 at.y(), at.x() + 8, at.y() - 6) +
           html_escaped(camera.name) + "</text>\n";
  }
  return svg +
         "</svg>\n<p>From above. A line is the wider the more views two cameras share; brown "
         "ones connected the rig.</p>\n";
}

/// Fields that boards reached, the darker the more corners.
std::string fields(const CameraFit& camera, ImageSize size) {
  BoardObservation all;
  for (const CornerResidual& r : camera.residuals) all.pixels.push_back(r.pixel);
  const BoardObservation* every = &all;
  const std::vector<int> counts = coverage_counts(size, {&every, 1});
  const int most = std::max(1, *std::max_element(counts.begin(), counts.end()));
  const double w = double(size.width) / kCoverageColumns, h = double(size.height) / kCoverageRows;
  std::string svg;
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const size_t column = i % kCoverageColumns, row = i / kCoverageColumns;
    svg += print(
        "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"#2a7\" "
        "fill-opacity=\"%.2f\"/>\n",
        w * static_cast<double>(column), h * static_cast<double>(row), w, h,
        0.15 + 0.4 * counts[i] / most);
  }
  return svg;
}

/// So long that an ordinary miss is a thirtieth of the image.
double enlargement(const CameraFit& camera, ImageSize size) {
  return camera.rms_px > 0 ? std::max(1.0, std::round(size.width / 30.0 / camera.rms_px)) : 1;
}

std::string arrows(const CameraFit& camera, double enlarged, double stroke) {
  std::string path;
  const size_t step = 1 + camera.residuals.size() / kMostArrows;
  for (size_t i = 0; i < camera.residuals.size(); i += step) {
    const CornerResidual& r = camera.residuals[i];
    path += print("M%.1f %.1fl%.1f %.1f", r.pixel.x(), r.pixel.y(), enlarged * r.miss.x(),
                  enlarged * r.miss.y());
  }
  return print("<path fill=\"none\" stroke=\"#c22\" stroke-width=\"%.1f\" d=\"", stroke) + path +
         "\"/>\n";
}

std::string camera_figure(const RigFit& fit, size_t index, const std::string& picture) {
  const CameraFit& camera = fit.cameras[index];
  const ImageSize size = fit.rig[index].model.size();
  const double enlarged = enlargement(camera, size);
  std::string html = print("<figure><svg width=\"440\" height=\"%.0f\" viewBox=\"0 0 %d %d\">\n",
                           440.0 * size.height / size.width, size.width, size.height);
  if (!picture.empty()) {
    html += print("<image width=\"%d\" height=\"%d\" opacity=\"0.6\" href=\"", size.width,
                  size.height) +
            picture + "\"/>\n";
  }
  html += fields(camera, size) + arrows(camera, enlarged, size.width / 600.0) + "</svg>\n";
  return html + "<figcaption><b>" + html_escaped(fit.rig[index].name) + "</b>: " +
         print("%.2f px RMS, %d views; misses enlarged %.0f times</figcaption></figure>\n",
               camera.rms_px, camera.views, enlarged);
}

std::string rejected(const RigFit& fit) {
  if (fit.rejected.empty()) return {};
  std::string html = "<h2>Pictures left out</h2>\n<ul>\n";
  for (const RejectedObservation& r : fit.rejected) {
    html += "<li>" + html_escaped(fit.rig[r.camera].name) +
            print(", instant %lld: ", static_cast<long long>(r.instant)) + html_escaped(r.reason) +
            "</li>\n";
  }
  return html + "</ul>\n";
}

}  // namespace

std::string report_html(const Board& board, const RigFit& fit,
                        const std::vector<std::string>& pictures) {
  std::string html = html_head("Calibration");
  html += print("<h1>Calibration of %zu cameras</h1>\n<p>%.2f px RMS over %zu places of the board ",
                fit.rig.size(), fit.rms_px, fit.world_from_board.size()) +
          html_escaped(board.text()) + ".</p>\n";
  html += table(fit) + "<h2>What is weak</h2>\n" + weak_points(fit) + "<h2>Shared views</h2>\n" +
          shared_views(fit) + "<h2>Images</h2>\n<div class=\"row\">\n";
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    html += camera_figure(fit, i, i < pictures.size() ? pictures[i] : std::string());
  }
  return html + "</div>\n" + rejected(fit) + "</body></html>\n";
}

}  // namespace v3d::calib
