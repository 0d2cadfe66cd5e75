#include "plan/plan_plot.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "base/core/text.h"
#include "plan/action_samples.h"

namespace v3d::plan {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSide = 560;  // SVG units of the longer side of the room
constexpr double kBorder = 40;
constexpr double kPersonM = 1.8;

/// A drawing of two axes of the world; the second one points up.
struct Frame {
  int across = 0, up = 1;  // world axes
  Vector2d low, high;      // world, metres
  double scale = 1, left = 0, top = 0;

  Vector2d at(const Vector3d& p) const {
    return {left + scale * (p[across] - low.x()), top + scale * (high.y() - p[up])};
  }
  double height() const { return scale * (high.y() - low.y()); }
};

Box room_of(const Rig& rig, const Box& space) {
  Box room = space;
  room.min.z() = std::min(room.min.z(), floor_of(space));
  for (const RigCamera& camera : rig) {
    room.min = room.min.cwiseMin(camera.model.center());
    room.max = room.max.cwiseMax(camera.model.center());
  }
  return room;
}

Frame frame_of(const Box& room, int up, double scale, double top) {
  return {0, up, {room.min.x(), room.min[up]}, {room.max.x(), room.max[up]}, scale, kBorder, top};
}

/// The number of cameras that have a standing person at (x, y) inside their image.
int cameras_at(const Rig& rig, double x, double y, double floor) {
  return static_cast<int>(std::ranges::count_if(rig, [&](const RigCamera& camera) {
    return std::ranges::all_of(std::array{0.0, 0.5 * kPersonM, kPersonM}, [&](double height) {
      const auto pixel = camera.model.project({x, y, floor + height});
      return pixel && camera.model.inside_image(*pixel);
    });
  }));
}

std::string colour_of(int cameras, size_t all) {
  const double share = static_cast<double>(cameras) / static_cast<double>(std::max<size_t>(1, all));
  const auto part = [&](int none, int every) {
    return static_cast<int>(std::lround(none + share * (every - none)));
  };
  return fmt::format("rgb({},{},{})", part(246, 16), part(248, 108), part(250, 120));
}

std::string rectangle(const Frame& frame, const Vector3d& low, const Vector3d& high,
                      const std::string& style) {
  const Vector2d a = frame.at(low), b = frame.at(high);
  return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" {}/>\n",
                     a.x(), b.y(), b.x() - a.x(), a.y() - b.y(), style);
}

std::string text(double x, double y, const std::string& words, const char* anchor = "start") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                     html_escaped(words));
}

std::string floor_cells(const Frame& frame, const Rig& rig, const Box& room, double floor) {
  constexpr int kCells = 48;
  const double step = std::max(room.size().x(), room.size().y()) / kCells;
  std::string cells = "<g shape-rendering=\"crispEdges\">\n";
  for (double y = room.min.y(); y < room.max.y() - 1e-9; y += step) {
    for (double x = room.min.x(); x < room.max.x() - 1e-9; x += step) {
      const int cameras = cameras_at(rig, x + step / 2, y + step / 2, floor);
      cells +=
          rectangle(frame, {x, y, floor},
                    {std::min(x + step, room.max.x()), std::min(y + step, room.max.y()), floor},
                    "fill=\"" + colour_of(cameras, rig.size()) + "\"");
    }
  }
  return cells + "</g>\n";
}

/// The camera as a triangle whose sides are those of its field of view, seen from above or aside.
std::string camera_mark(const Frame& frame, const RigCamera& camera, bool is_fixed, double size) {
  const ImageSize image = camera.model.size();
  const Vector2d eye = frame.at(camera.model.center());
  std::string points = fmt::format("{:.1f},{:.1f}", eye.x(), eye.y());
  const double middle_x = 0.5 * (image.width - 1), middle_y = 0.5 * (image.height - 1);
  const bool above = frame.up == 1;
  for (const double side : {0.0, 1.0}) {
    const Vector2d pixel = above ? Vector2d(side * (image.width - 1), middle_y)
                                 : Vector2d(middle_x, side * (image.height - 1));
    const Vector3d ray = camera.model.ray(pixel).value_or(camera.model.viewing_direction());
    const Vector2d end = frame.at(camera.model.center() + size * ray);
    points += fmt::format(" {:.1f},{:.1f}", end.x(), end.y());
  }
  const char* colour = is_fixed ? "#7a5c00" : "#b3261e";
  return fmt::format(
             "<polygon points=\"{}\" fill=\"{}\" fill-opacity=\"0.18\" stroke=\"{}\"/>\n"
             "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n",
             points, colour, colour, eye.x(), eye.y(), colour) +
         (above ? text(eye.x() + 5, eye.y() - 5, camera.name) : "");
}

std::string legend(size_t cameras, double x, double y) {
  std::string drawn = text(x, y - 6, "Cameras that have a standing person wholly in the image:");
  const size_t steps = std::min<size_t>(cameras, 5);
  for (size_t i = 0; i <= steps; ++i) {
    const auto count = static_cast<int>(i * cameras / std::max<size_t>(1, steps));
    const double left = x + 60 * static_cast<double>(i);
    drawn += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"18\" height=\"12\" fill=\"{}\" "
        "stroke=\"#888\"/>\n",
        left, y, colour_of(count, cameras));
    drawn += text(left + 24, y + 11, std::to_string(count));
  }
  return drawn;
}

}  // namespace

std::string plot_of(const Rig& rig, size_t fixed, const Box& space) {
  const Box room = room_of(rig, space);
  const double scale = kSide / std::max(room.size().x(), room.size().y());
  const double floor = floor_of(space);
  const double mark = 0.09 * std::max(room.size().x(), room.size().y());
  const Frame plan = frame_of(room, 1, scale, kBorder);
  const Frame elevation = frame_of(room, 2, scale, kBorder + plan.height() + 2 * kBorder);
  const double bottom = elevation.top + elevation.height() + 2 * kBorder;
  const double width = scale * room.size().x() + 2 * kBorder + 40;
  std::string drawn = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" "
      "font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"white\"/>\n",
      std::max(width, 420.0), bottom + kBorder);
  const std::string outline = "fill=\"none\" stroke=\"#333\" stroke-dasharray=\"5 3\"";
  drawn += text(kBorder, 18, "Plan view (x to the right, y up); dashed: the space");
  drawn += floor_cells(plan, rig, room, floor) + rectangle(plan, space.min, space.max, outline);
  drawn += text(kBorder, elevation.top - 22, "Elevation (x to the right, z up)");
  drawn += rectangle(elevation, room.min, room.max, "fill=\"#f6f8fa\"") +
           rectangle(elevation, space.min, space.max, outline);
  for (const Frame& frame : {plan, elevation}) {
    for (size_t i = 0; i < rig.size(); ++i) drawn += camera_mark(frame, rig[i], i < fixed, mark);
  }
  drawn += text(kBorder, elevation.top + elevation.height() + 24,
                fmt::format("Room of {:.1f} m x {:.1f} m", room.size().x(), room.size().y()));
  return drawn + legend(rig.size(), kBorder, bottom) + "</svg>\n";
}

}  // namespace v3d::plan
