#include "calib/rig/reports.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/core/statistics.h"
#include "base/core/text.h"
#include "calib/boards/board.h"
#include "calib/lens/lens_fit.h"

namespace v3d::calib {
namespace {

// --- weaknesses

constexpr int kMinSharedViews = 12;
constexpr double kMinCoverage = 0.4;
constexpr double kMaxRmsRatio = 2;
constexpr double kMaxRmsPx = 1;

struct Neighbour {
  int camera = -1;
  int inliers = 0;
  int sum = 0;  ///< over all neighbours
};

Neighbour best_neighbour(const RigFit& fit, int camera) {
  Neighbour best;
  for (const PairPose& pair : fit.pairs) {
    if (pair.a != camera && pair.b != camera) continue;
    best.sum += pair.inliers;
    if (pair.inliers <= best.inliers) continue;
    best.inliers = pair.inliers;
    best.camera = pair.a == camera ? pair.b : pair.a;
  }
  return best;
}

/// The camera at the smallest distance. The board should be shown to both.
int nearest_camera(const Rig& rig, int camera) {
  int nearest = -1;
  double smallest = 0;
  for (int other = 0; other < static_cast<int>(rig.size()); ++other) {
    if (other == camera) continue;
    const double d = (rig[other].model.center() - rig[camera].model.center()).norm();
    if (nearest < 0 || d < smallest) {
      smallest = d;
      nearest = other;
    }
  }
  return nearest;
}

void check_shared_views(const RigFit& fit, std::vector<std::string>& weaknesses) {
  for (int i = 0; i < static_cast<int>(fit.rig.size()); ++i) {
    const Neighbour best = best_neighbour(fit, i);
    if (best.inliers >= kMinSharedViews) continue;
    const std::string& name = fit.rig[i].name;
    weaknesses.push_back(name + " shares " + std::to_string(best.sum) +
                         " views with its neighbours: show the board between " + name + " and " +
                         fit.rig[nearest_camera(fit.rig, i)].name);
  }
}

/// A ninth of the image without corners, in words; empty where all ninths have corners.
std::string uncovered_part(const CameraFit& camera, ImageSize size) {
  int counts[3][3] = {};
  for (const CornerResidual& r : camera.residuals) {
    const int x = std::clamp(static_cast<int>(3 * (r.pixel.x() + 0.5) / size.width), 0, 2);
    const int y = std::clamp(static_cast<int>(3 * (r.pixel.y() + 0.5) / size.height), 0, 2);
    ++counts[y][x];
  }
  constexpr const char* kRows[] = {"upper", "middle", "lower"};
  constexpr const char* kColumns[] = {"left", "middle", "right"};
  for (int y : {0, 2, 1}) {
    for (int x : {0, 2, 1}) {
      if (counts[y][x] == 0) return std::string(kRows[y]) + " " + kColumns[x];
    }
  }
  return {};
}

void check_coverage(const RigFit& fit, std::vector<std::string>& weaknesses) {
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const CameraFit& camera = fit.cameras[i];
    if (camera.coefficients == 0 || camera.coverage >= kMinCoverage) continue;
    const std::string text =
        fmt::format(": boards covered {:.0f} % of its image", 100 * camera.coverage);
    const std::string part = uncovered_part(camera, fit.rig[i].model.size());
    weaknesses.push_back(
        fit.rig[i].name + text +
        (part.empty() ? ": show the board closer to the image borders"
                      : ": show the board in the " + part + " part, and closer to the camera"));
  }
}

void check_focal_lengths(const RigFit& fit, std::vector<std::string>& weaknesses) {
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    std::string text = focal_weakness(fit.rig[i].name, fit.cameras[i].focal_deviation);
    if (!text.empty()) weaknesses.push_back(std::move(text));
  }
}

/// What is compared with the residuals of one camera: the median camera, of two the better one.
double median_rms(const RigFit& fit) {
  std::vector<double> rms;
  for (const CameraFit& camera : fit.cameras) rms.push_back(camera.rms_px);
  return percentile(rms, 0.5);
}

/// A cause that all cameras share shows in no comparison between them.
void check_common_error(const RigFit& fit, std::vector<std::string>& weaknesses) {
  const double median = median_rms(fit);
  if (median <= kMaxRmsPx) return;
  const bool has_known_lenses =
      std::any_of(fit.cameras.begin(), fit.cameras.end(),
                  [](const CameraFit& camera) { return camera.coefficients == 0; });
  weaknesses.push_back(
      fmt::format("the median camera has an RMS residual of {:.1f} px, expected at most {:.0f}: is "
                  "the board flat, are its squares square, are the cameras synchronised?",
                  median, kMaxRmsPx) +
      (has_known_lenses ? " Do the lenses of the previous calibration still fit (focus, zoom)? "
                          "Else calibrate without it"
                        : ""));
}

void check_error(const CameraFit& camera, const std::string& name, double median,
                 std::vector<std::string>& weaknesses) {
  const bool is_alone = median <= kMaxRmsPx && camera.rms_px > kMaxRmsPx;
  if (camera.rms_px <= kMaxRmsRatio * median && !is_alone) return;
  weaknesses.push_back(
      name +
      fmt::format(" has an RMS residual of {:.2f} px, the median camera {:.2f} px: check focus, "
                  "mounting and trigger",
                  camera.rms_px, median) +
      (camera.coefficients == 0
           ? "; after a change of focus or zoom, calibrate without the previous calibration"
           : ""));
}

void check_errors(const RigFit& fit, std::vector<std::string>& weaknesses) {
  check_common_error(fit, weaknesses);
  const double median = median_rms(fit);
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const CameraFit& camera = fit.cameras[i];
    check_error(camera, fit.rig[i].name, median, weaknesses);
    if (4 * camera.rejected > camera.views) {
      weaknesses.push_back(fit.rig[i].name + ": " + std::to_string(camera.rejected) +
                           " images were rejected: move the board more slowly, or use more light");
    }
    if (std::abs(camera.time_offset) > 0.02) {
      const std::string text =
          fmt::format(" is {:.2f} images {}: check its trigger", std::abs(camera.time_offset),
                      camera.time_offset > 0 ? "late" : "early");
      weaknesses.push_back(fit.rig[i].name + text);
    }
  }
}

// --- page

constexpr int kMaxArrows = 600;  // of a camera; more would be unreadable

std::string pose_table(const RigFit& fit) {
  std::string html =
      "<table><tr><th>camera</th><th>RMS, px</th><th>views</th><th>rejected</th>"
      "<th>coverage</th><th>coefficients</th><th>time offset, images</th></tr>\n";
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const CameraFit& c = fit.cameras[i];
    html += "<tr><td>" + html_escaped(fit.rig[i].name) +
            fmt::format("</td><td>{:.2f}</td><td>{}</td><td>{}</td><td>{:.0f} %</td><td>{}</td>",
                        c.rms_px, c.views, c.rejected, 100 * c.coverage,
                        c.coefficients ? std::to_string(c.coefficients) : "known") +
            fmt::format("<td>{:.2f}</td></tr>\n", c.time_offset);
  }
  return html + "</table>\n";
}

std::string weakness_list(const RigFit& fit) {
  const std::vector<std::string> weaknesses = find_weaknesses(fit);
  if (weaknesses.empty()) return "<p>No weaknesses.</p>\n";
  std::string html = "<ul>\n";
  for (const std::string& sentence : weaknesses)
    html += "<li>" + html_escaped(sentence) + "</li>\n";
  return html + "</ul>\n";
}

/// Projects the rig from above to a square.
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
  std::string svg =
      fmt::format("<svg width=\"{:.0f}\" height=\"{:.0f}\">\n", Map::kSide, Map::kSide);
  int largest = 1;
  for (const PairPose& pair : fit.pairs) largest = std::max(largest, pair.inliers);
  for (const PairPose& pair : fit.pairs) {
    if (pair.inliers == 0) continue;
    const Eigen::Vector2d a = map(fit.rig[pair.a].model.center());
    const Eigen::Vector2d b = map(fit.rig[pair.b].model.center());
    svg += fmt::format(
               "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" "
               "stroke-width=\"{:.1f}\"><title>",
               a.x(), a.y(), b.x(), b.y(), in_tree(fit.tree, pair) ? "#d2691e" : "#9ab",
               0.5 + 6.0 * pair.inliers / largest) +
           html_escaped(fit.rig[pair.a].name) + " and " + html_escaped(fit.rig[pair.b].name) +
           fmt::format(": {} shared views, {} inliers</title></line>\n", pair.shared, pair.inliers);
  }
  for (const RigCamera& camera : fit.rig) {
    const Eigen::Vector2d at = map(camera.model.center());
    svg +=
        fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"5\"/><text x=\"{:.1f}\" y=\"{:.1f}\">",
                    at.x(), at.y(), at.x() + 8, at.y() - 6) +
        html_escaped(camera.name) + "</text>\n";
  }
  return svg +
         "</svg>\n<p>View from above. The width of a line is the number of views that two cameras "
         "share. Brown lines are the spanning tree.</p>\n";
}

/// Image cells with corners; the opacity is the number of corners.
std::string coverage_cells(const CameraFit& camera, ImageSize size) {
  BoardObservation all;
  for (const CornerResidual& r : camera.residuals) all.pixels.push_back(r.pixel);
  const BoardObservation* every = &all;
  const std::vector<int> counts = coverage_counts(size, {&every, 1});
  const int largest = std::max(1, *std::max_element(counts.begin(), counts.end()));
  const double w = double(size.width) / kCoverageColumns, h = double(size.height) / kCoverageRows;
  std::string svg;
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const size_t column = i % kCoverageColumns, row = i / kCoverageColumns;
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#2a7\" "
        "fill-opacity=\"{:.2f}\"/>\n",
        w * static_cast<double>(column), h * static_cast<double>(row), w, h,
        0.15 + 0.4 * counts[i] / largest);
  }
  return svg;
}

/// The factor that makes the RMS residual a thirtieth of the image width.
double enlargement(const CameraFit& camera, ImageSize size) {
  return camera.rms_px > 0 ? std::max(1.0, std::round(size.width / 30.0 / camera.rms_px)) : 1;
}

std::string arrows(const CameraFit& camera, double enlarged, double stroke) {
  std::string path;
  const size_t step = 1 + camera.residuals.size() / kMaxArrows;
  for (size_t i = 0; i < camera.residuals.size(); i += step) {
    const CornerResidual& r = camera.residuals[i];
    path += fmt::format("M{:.1f} {:.1f}l{:.1f} {:.1f}", r.pixel.x(), r.pixel.y(),
                        enlarged * r.residual.x(), enlarged * r.residual.y());
  }
  return fmt::format("<path fill=\"none\" stroke=\"#c22\" stroke-width=\"{:.1f}\" d=\"", stroke) +
         path + "\"/>\n";
}

std::string camera_figure(const RigFit& fit, size_t index, const std::string& image) {
  const CameraFit& camera = fit.cameras[index];
  const ImageSize size = fit.rig[index].model.size();
  const double enlarged = enlargement(camera, size);
  std::string html =
      fmt::format("<figure><svg width=\"440\" height=\"{:.0f}\" viewBox=\"0 0 {} {}\">\n",
                  440.0 * size.height / size.width, size.width, size.height);
  if (!image.empty()) {
    html += fmt::format("<image width=\"{}\" height=\"{}\" opacity=\"0.6\" href=\"", size.width,
                        size.height) +
            image + "\"/>\n";
  }
  html += coverage_cells(camera, size) + arrows(camera, enlarged, size.width / 600.0) + "</svg>\n";
  return html + "<figcaption><b>" + html_escaped(fit.rig[index].name) + "</b>: " +
         fmt::format(
             "{:.2f} px RMS, {} views; residuals enlarged {:.0f} times</figcaption></figure>\n",
             camera.rms_px, camera.views, enlarged);
}

std::string rejected(const RigFit& fit) {
  if (fit.rejected.empty()) return {};
  std::string html = "<h2>Rejected images</h2>\n<ul>\n";
  for (const RejectedObservation& r : fit.rejected) {
    html += "<li>" + html_escaped(fit.rig[r.camera].name) +
            fmt::format(", instant {}: ", r.instant) + html_escaped(r.reason) + "</li>\n";
  }
  return html + "</ul>\n";
}

}  // namespace

std::vector<std::string> find_weaknesses(const RigFit& fit) {
  std::vector<std::string> weaknesses;
  check_shared_views(fit, weaknesses);
  check_errors(fit, weaknesses);
  check_focal_lengths(fit, weaknesses);
  check_coverage(fit, weaknesses);
  return weaknesses;
}

std::string rig_report_html(const Board& board, const RigFit& fit,
                            const std::vector<std::string>& images) {
  std::string html = html_head("Calibration");
  html += fmt::format(
              "<h1>Calibration of {} cameras</h1>\n<p>{:.2f} px RMS over {} poses of the board ",
              fit.rig.size(), fit.rms_px, fit.world_from_board.size()) +
          html_escaped(board.text()) + ".</p>\n";
  html += pose_table(fit) + "<h2>Weaknesses</h2>\n" + weakness_list(fit) +
          "<h2>Shared views</h2>\n" + shared_views(fit) + "<h2>Images</h2>\n<div class=\"row\">\n";
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    html += camera_figure(fit, i, i < images.size() ? images[i] : std::string());
  }
  return html + "</div>\n" + rejected(fit) + "</body></html>\n";
}

namespace {

constexpr int kMaxPlaces = 24;  // in the page

std::string colour_table(const std::vector<std::string>& cameras, const ColourFit& fit) {
  std::string html =
      "<table><tr><th>camera</th><th>&Delta;E before</th><th>after</th><th>places</th>"
      "<th>black level</th><th>gain of R</th><th>G</th><th>B</th></tr>\n";
  for (size_t i = 0; i < cameras.size(); ++i) {
    const ColourDifference& d = fit.differences[i];
    const ColourResponse& r = fit.responses[i];
    html +=
        "<tr><td>" + html_escaped(cameras[i]) +
        fmt::format("</td><td>{:.2f}</td><td>{:.2f}</td><td>{}</td><td>{:.1f} {:.1f} {:.1f}</td>",
                    d.before, d.after, d.places, r.black[0], r.black[1], r.black[2]) +
        fmt::format("<td>{:.3f}</td><td>{:.3f}</td><td>{:.3f}</td></tr>\n", r.matrix.row(0).sum(),
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
  return fmt::format(
      "<rect x=\"{:.0f}\" y=\"{:.0f}\" width=\"22\" height=\"22\" fill=\"rgb({},{},{})\"/>\n", x, y,
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
  std::string svg = fmt::format("<svg width=\"680\" height=\"{:.0f}\">\n", 24 * rows);
  for (const ColourSample& sample : samples) {
    const auto place = column.find(sample.place);
    if (place == column.end()) continue;
    const Eigen::Vector3d grey =
        after ? fit.responses[sample.camera].corrected(sample.grey) : sample.grey;
    svg += square(90 + 24.0 * place->second, 24.0 * sample.camera, grey);
  }
  for (size_t i = 0; i < cameras.size(); ++i) {
    svg += fmt::format("<text x=\"2\" y=\"{:.0f}\">", 24.0 * static_cast<double>(i) + 16) +
           html_escaped(cameras[i]) + "</text>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace

std::string colour_report_html(const std::vector<std::string>& cameras, const ColourFit& fit,
                               std::span<const ColourSample> samples) {
  return html_head("Colours") + fmt::format("<h1>Colours of {} cameras</h1>\n<p>", cameras.size()) +
         fmt::format(
             "Difference between each camera's colours and those of the others at the same places: "
             "&Delta;E (CIE 2000) {:.2f} before, {:.2f} after (median); 90th percentile {:.2f}, "
             "{:.2f}.</p>\n",
             fit.overall.before, fit.overall.after, fit.ninety_percent.before,
             fit.ninety_percent.after) +
         colour_table(cameras, fit) + "<h2>Before</h2>\n" + squares(cameras, fit, samples, false) +
         "<h2>After</h2>\n" + squares(cameras, fit, samples, true) +
         "<p>Columns are places, rows are cameras.</p>\n</body></html>\n";
}

}  // namespace v3d::calib
