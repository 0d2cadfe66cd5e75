#include "calibrate/colour_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "calib/boards/detectors.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/texture/texture.h"
#include "recon/visibility/depth_buffer.h"
#include "take/take.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {
namespace {

using calib::ColourSample;
using Eigen::Vector3d;

constexpr int kMaxImages = 20;  // of each camera

int camera_of(const NamedSource& source, const std::vector<std::string>& names) {
  const auto found = std::ranges::find(names, source.camera);
  if (found == names.end()) {
    throw InputError(source.camera + ": no such camera in the calibration, which has " +
                     join_names(names));
  }
  return static_cast<int>(found - names.begin());
}

/// The mean of the middle ninth of an image.
Vector3d middle_colour(ImageView image) {
  const Image rgb = to_rgb(image);
  const int x0 = rgb.size.width / 3, y0 = rgb.size.height / 3;
  Vector3d sum = Vector3d::Zero();
  int64_t count = 0;
  for (int y = y0; y < rgb.size.height - y0; ++y) {
    const uint8_t* row = rgb.row(y);
    for (int x = x0; x < rgb.size.width - x0; ++x, ++count) {
      sum += Vector3d(row[3 * x], row[3 * x + 1], row[3 * x + 2]);
    }
  }
  return sum / static_cast<double>(std::max<int64_t>(1, count));
}

/// The mean of several observations of the chart by one camera.
class ChartMean {
 public:
  void add(const calib::ChartColours& colours) {
    for (size_t i = 0; i < colours.size(); ++i) {
      if (!calib::is_well_exposed(colours[i])) continue;
      sums_[i] += colours[i];
      ++counts_[i];
    }
    ++charts_;
  }
  int charts() const { return charts_; }
  void put(int camera, std::vector<ColourSample>& samples) const {
    for (size_t i = 0; i < sums_.size(); ++i) {
      if (counts_[i] > 0) samples.push_back({static_cast<int>(i), camera, sums_[i] / counts_[i]});
    }
  }

 private:
  std::array<Vector3d, 24> sums_ = [] {
    std::array<Vector3d, 24> zeros;
    zeros.fill(Vector3d::Zero());
    return zeros;
  }();
  std::array<int, 24> counts_{};
  int charts_ = 0;
};

}  // namespace

std::vector<ColourSample> find_charts(std::vector<NamedSource> sources,
                                      const std::vector<std::string>& names) {
  std::vector<ColourSample> samples;
  for (NamedSource& source : sources) {
    const int camera = camera_of(source, names);
    ChartMean mean;
    while (mean.charts() < kMaxImages) {
      ctl::stop_if_interrupted();
      const auto image = source.source.next();
      if (!image) break;
      if (const auto chart = calib::find_chart(image->pixels.view())) mean.add(*chart);
    }
    if (mean.charts() == 0) {
      throw InputError(source.source.name + ": no colour chart with 24 patches found; show it to " +
                       source.camera + " completely and frontally, at least 150 pixels wide");
    }
    mean.put(camera, samples);
  }
  return samples;
}

std::vector<ColourSample> find_grey(std::vector<NamedSource> sources,
                                    const std::vector<std::string>& names) {
  std::vector<ColourSample> samples;
  for (NamedSource& source : sources) {
    const int camera = camera_of(source, names);
    for (int i = 0; i < kMaxImages; ++i) {
      ctl::stop_if_interrupted();
      const auto image = source.source.next();
      if (!image) break;
      const Vector3d grey = middle_colour(image->pixels.view());
      if (calib::is_well_exposed(grey)) samples.push_back({0, camera, grey});
    }
  }
  return samples;
}

std::vector<Vector3d> find_black(std::vector<NamedSource> sources,
                                 const std::vector<std::string>& names) {
  std::vector<std::optional<Vector3d>> black(names.size());
  for (NamedSource& source : sources) {
    const int camera = camera_of(source, names);
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    for (; count < kMaxImages; ++count) {
      ctl::stop_if_interrupted();
      const auto image = source.source.next();
      if (!image) break;
      sum += middle_colour(image->pixels.view());
    }
    black[camera] = sum / std::max(1, count);
  }
  std::vector<Vector3d> result;
  for (size_t c = 0; c < names.size(); ++c) {
    if (!black[c]) throw InputError("--dark: no image of " + names[c]);
    result.push_back(*black[c]);
  }
  return result;
}

namespace {

constexpr size_t kMaxFrames = 10;
constexpr size_t kPlacesPerFrame = 400;

/// Statistics of the colours around a place.
class Patch {
 public:
  void add(const std::optional<Eigen::Vector3f>& colour) {
    if (!colour) {
      good_ = false;
      return;
    }
    const Vector3d c = colour->cast<double>();
    good_ = good_ && calib::is_well_exposed(c);
    sum_ += c;
    squares_ += c.cwiseProduct(c);
    ++count_;
  }
  Vector3d mean() const { return sum_ / count_; }
  /// The mean colour; empty where a colour is badly exposed or their deviation exceeds `spread`.
  std::optional<Vector3d> colour(double spread) const {
    if (!good_ || count_ == 0) return std::nullopt;
    const Vector3d variance = squares_ / count_ - mean().cwiseProduct(mean());
    if (variance.maxCoeff() > spread * spread) return std::nullopt;
    return mean();
  }

 private:
  bool good_ = true;
  int count_ = 0;
  Vector3d sum_ = Vector3d::Zero(), squares_ = Vector3d::Zero();
};

// --- surface

double edge_length(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    sum += (mesh.vertices[a] - mesh.vertices[b]).norm();
  }
  return sum / static_cast<double>(std::max<size_t>(1, mesh.triangles.size()));
}

/// The image of a surface in one camera.
class SurfaceView {
 public:
  SurfaceView(const CameraModel& model, const recorded::SegmentedFrame& frame, const Mesh& mesh)
      : model_(model), frame_(frame), depth_(recon::draw_depth(mesh, model)) {}

  /// `tolerance_m`: accuracy of the surface.
  std::optional<Vector3d> colour_at(const Vector3d& position, const Vector3d& normal,
                                    double tolerance_m) const {
    constexpr double kMinFacing = 0.5;
    const Vector3d to_camera = (model_.center() - position).normalized();
    const auto pixel = model_.project(position);
    if (normal.dot(to_camera) < kMinFacing || !pixel) return std::nullopt;
    Patch patch;
    constexpr int kReach = 2;
    for (int dy = -kReach; dy <= kReach; dy += kReach) {
      for (int dx = -kReach; dx <= kReach; dx += kReach) {
        const Eigen::Vector2d at = *pixel + Eigen::Vector2d(dx, dy);
        if (!shows(at, position, tolerance_m)) return std::nullopt;
        patch.add(recon::sample_colour(frame_.raw.image.view(), at.x(), at.y()));
      }
    }
    constexpr double kMaxSpread =
        8;  // grey values; avoids colour edges, which are displaced between images
    return patch.colour(kMaxSpread);
  }

 private:
  bool shows(const Eigen::Vector2d& pixel, const Vector3d& position, double tolerance_m) const {
    if (!model_.inside_image(pixel)) return false;
    const int x = static_cast<int>(std::floor(pixel.x() + 0.5));
    const int y = static_cast<int>(std::floor(pixel.y() + 0.5));
    const double z = (model_.cam_from_world() * position).z();
    return frame_.mask.get(x, y) && std::abs(depth_.at(x, y) - z) < tolerance_m;
  }

  const CameraModel& model_;
  const recorded::SegmentedFrame& frame_;
  recon::DepthBuffer depth_;
};

/// `numbers`: indices of the recorded cameras in the rig.
void add_frame(const Mesh& mesh, const Rig& rig, const std::vector<int>& numbers,
               const std::vector<std::optional<recorded::SegmentedFrame>>& frames, int& place,
               std::vector<ColourSample>& samples) {
  std::vector<std::optional<SurfaceView>> views(rig.size());
  for (size_t c = 0; c < rig.size(); ++c) {
    if (frames[c]) views[c].emplace(rig[c].model, *frames[c], mesh);
  }
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  const double tolerance = 4 * edge_length(mesh);
  const size_t step = std::max<size_t>(1, mesh.vertices.size() / kPlacesPerFrame);
  for (size_t v = 0; v < mesh.vertices.size(); v += step, ++place) {
    for (size_t c = 0; c < rig.size(); ++c) {
      if (!views[c]) continue;
      const auto colour = views[c]->colour_at(mesh.vertices[v].cast<double>(),
                                              normals[v].cast<double>(), tolerance);
      if (colour) samples.push_back({place, numbers[c], *colour});
    }
  }
}

std::vector<int> numbers_in(const Rig& rig, const Rig& recorded) {
  std::vector<int> numbers;
  for (const RigCamera& camera : recorded) {
    numbers.push_back(find_camera(rig, camera.name));
    if (numbers.back() < 0) {
      throw InputError(camera.name + ": is in the take but not in the calibration");
    }
  }
  return numbers;
}

// --- floor

/// The background plate of a camera; empty where the take has none.
std::optional<Image> plate_of(const take::TakePaths& take, const RigCamera& camera) {
  const auto model = recorded::load_take_background(take, camera.name);
  if (!model) return std::nullopt;
  if (!(model->size == camera.model.size())) {
    throw InputError(camera.name + ": its plates are " + format_size(model->size) +
                     ", but it was calibrated at " + format_size(camera.model.size()));
  }
  Image image(model->size, model->format);
  std::ranges::transform(model->mean, image.bytes.begin(), [](float mean) {
    return static_cast<uint8_t>(std::clamp(std::lround(mean), 0L, 255L));
  });
  return image;
}

/// The mean colour of a floor patch of fixed size, which does not depend on the camera's distance.
std::optional<Vector3d> floor_colour(const CameraModel& model, ImageView plate,
                                     const Vector3d& at) {
  constexpr double kHalfSide = 0.04;  // metres
  constexpr int kSteps = 4;
  constexpr double kMaxSpread =
      40;  // large, because the mean of a pattern is the same in all cameras
  Patch patch;
  for (int j = -kSteps; j <= kSteps; ++j) {
    for (int i = -kSteps; i <= kSteps; ++i) {
      const auto pixel = model.project(at + kHalfSide / kSteps * Vector3d(i, j, 0));
      if (!pixel) return std::nullopt;
      patch.add(recon::sample_colour(plate, pixel->x(), pixel->y()));
    }
  }
  return patch.colour(kMaxSpread);
}

}  // namespace

std::vector<ColourSample> surface_places(const std::filesystem::path& take, const Rig& rig,
                                         int first_place) {
  recorded::MeshFrames meshes(take);
  recorded::TakeFrames recorded(take, {});
  const std::vector<int> numbers = numbers_in(rig, recorded.rig());
  const std::vector<int64_t> frames = meshes.frames({});
  const size_t count = std::min(kMaxFrames, frames.size());
  std::vector<ColourSample> samples;
  int place = first_place;
  int64_t incomplete = 0;
  Progress progress("compare colours", static_cast<int64_t>(count));
  for (size_t i = 0; i < count; ++i) {
    ctl::stop_if_interrupted();
    const int64_t frame = frames[i * frames.size() / count];
    const auto views = recorded.read(frame);
    if (std::ranges::any_of(views, [](const auto& view) { return !view; })) ++incomplete;
    add_frame(meshes.read(frame).mesh, recorded.rig(), numbers, views, place, samples);
    progress.advance();
  }
  ctl::report_incomplete_frames(incomplete, take);
  return samples;
}

std::vector<ColourSample> floor_places(const std::filesystem::path& take, const Rig& rig,
                                       int first_place) {
  constexpr double kStep = 0.12;  // metres
  const take::TakePaths paths{take};
  std::vector<std::optional<Image>> plates;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const RigCamera& camera : rig) {
    plates.push_back(plate_of(paths, camera));
    low = low.cwiseMin(camera.model.center().head<2>());
    high = high.cwiseMax(camera.model.center().head<2>());
  }
  constexpr double kMaxExtent = 200;  // metres
  if ((high - low).maxCoeff() > kMaxExtent) {
    throw InputError(
        "floor: the cameras are more than 200 m apart; check the unit of the calibration");
  }
  std::vector<ColourSample> samples;
  int place = first_place;
  for (double y = low.y(); y <= high.y(); y += kStep) {
    ctl::stop_if_interrupted();
    for (double x = low.x(); x <= high.x(); x += kStep, ++place) {
      for (size_t c = 0; c < rig.size(); ++c) {
        if (!plates[c] || plates[c]->format == PixelFormat::kMono8) continue;
        const auto colour = floor_colour(rig[c].model, plates[c]->view(), {x, y, 0});
        if (colour) samples.push_back({place, static_cast<int>(c), *colour});
      }
    }
  }
  return samples;
}

}  // namespace v3d::calibrate
