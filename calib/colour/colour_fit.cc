#include "calib/colour/colour_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <string>

#include "base/core/error.h"
#include "base/core/statistics.h"

namespace v3d::calib {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;
/// One row for each output channel: gains of R, G, B and an offset, relative to white (255).
using Correction = Eigen::Matrix<double, 3, 4>;
using Places = std::map<int, std::vector<const ColourSample*>>;

constexpr double kWhite = 255;
constexpr int kHoldOutEvery = 5;

/// Places with samples of at least two cameras.
Places shared_places(std::span<const ColourSample> samples) {
  Places places;
  for (const ColourSample& sample : samples) places[sample.place].push_back(&sample);
  std::erase_if(places, [](const auto& place) { return place.second.size() < 2; });
  return places;
}

Vector4d extended(const Vector3d& grey) { return (grey / kWhite).homogeneous(); }

Correction identity() {
  Correction a = Correction::Zero();
  a.leftCols<3>().setIdentity();
  return a;
}

/// corrected(v) = M v + o = M (v + M^-1 o).
ColourResponse response_of(const Correction& a) {
  const Eigen::Matrix3d matrix = a.leftCols<3>();
  return {-kWhite * matrix.inverse() * a.col(3), matrix};
}

// --- differences

class Differences {
 public:
  Differences(const Places& places, std::vector<ColourResponse> responses)
      : responses_(std::move(responses)), by_camera_(responses_.size()) {
    for (const auto& [place, samples] : places) {
      for (const ColourSample* sample : samples) add(*sample, samples);
    }
  }

  ColourDifference of(size_t camera) const { return at(by_camera_[camera], 0.5); }
  ColourDifference all(double part) const {
    Pairs pairs;
    for (const Pairs& p : by_camera_) pairs.insert(pairs.end(), p.begin(), p.end());
    return at(pairs, part);
  }

 private:
  struct Pair {
    double before, after;
  };
  using Pairs = std::vector<Pair>;

  void add(const ColourSample& own, const std::vector<const ColourSample*>& samples) {
    Vector3d before = Vector3d::Zero(), after = Vector3d::Zero();
    for (const ColourSample* other : samples) {
      if (other == &own) continue;
      before += other->grey;
      after += responses_[other->camera].corrected(other->grey);
    }
    const double scale = 1 / (kWhite * static_cast<double>(samples.size() - 1));
    const Vector3d mine = responses_[own.camera].corrected(own.grey) / kWhite;
    by_camera_[own.camera].push_back(
        {delta_e_2000(lab_of(own.grey / kWhite), lab_of(before * scale)),
         delta_e_2000(lab_of(mine), lab_of(after * scale))});
  }

  static ColourDifference at(const Pairs& pairs, double part) {
    std::vector<double> before, after;
    for (const Pair& pair : pairs) {
      before.push_back(pair.before);
      after.push_back(pair.after);
    }
    return {static_cast<int>(pairs.size()), percentile(before, part), percentile(after, part)};
  }

  std::vector<ColourResponse> responses_;
  std::vector<Pairs> by_camera_;
};

ColourFit with_differences(const Places& places, std::vector<ColourResponse> responses) {
  const Differences differences(places, responses);
  ColourFit fit;
  for (size_t c = 0; c < responses.size(); ++c) fit.differences.push_back(differences.of(c));
  fit.fitted.assign(responses.size(), true);
  fit.responses = std::move(responses);
  fit.overall = differences.all(0.5);
  fit.ninety_percent = differences.all(0.9);
  return fit;
}

// --- views

/// The group of each camera, numbered by one of its cameras: shared places connect its cameras.
std::vector<int> groups_of(const Places& places, size_t cameras) {
  std::vector<int> groups(cameras);
  std::iota(groups.begin(), groups.end(), 0);
  for (const auto& [number, samples] : places) {
    for (const ColourSample* sample : samples) {
      const int from = groups[sample->camera], to = groups[samples.front()->camera];
      if (from != to) std::ranges::replace(groups, from, to);
    }
  }
  return groups;
}

/// All corrections of a rig, from places that several cameras show.
class ViewSolver {
 public:
  ViewSolver(const Places& places, const ColourOptions& options)
      : places_(places),
        cameras_(static_cast<int>(options.cameras.size())),
        groups_(groups_of(places, options.cameras.size())),
        black_known_(!options.black.empty()),
        corrections_(options.cameras.size(), identity()) {}

  std::vector<Correction> solve() {
    constexpr int kIterations = 6;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      build_normal_matrix();
      for (int channel = 0; channel < 3; ++channel) solve_channel(channel);
    }
    return corrections_;
  }

 private:
  struct Place {
    Vector3d colour;
    double weight;
  };

  /// The mean of the corrected samples. Dark places weigh more: L* is a cube root of the luminance.
  Place place_of(const std::vector<const ColourSample*>& samples) const {
    Vector3d sum = Vector3d::Zero();
    for (const ColourSample* sample : samples) sum += corrected(*sample);
    const Vector3d mean = sum / static_cast<double>(samples.size());
    return {mean, std::pow(std::max(0.0, mean.mean()) + 0.05, -4.0 / 3) * 0.2};
  }

  Vector3d corrected(const ColourSample& sample) const {
    return corrections_[sample.camera] * extended(sample.grey);
  }

  double typical_residual() const {
    std::vector<double> residuals;
    for (const auto& [number, samples] : places_) {
      const Vector3d mean = place_of(samples).colour;
      for (const ColourSample* sample : samples)
        residuals.push_back((corrected(*sample) - mean).norm());
    }
    return std::max(1e-6, percentile(residuals, 0.5));
  }

  /// The normal matrix of the residuals with the places eliminated; it is the same for all
  /// channels.
  void build_normal_matrix() {
    const int size = 4 * cameras_;
    normal_matrix_ = Eigen::MatrixXd::Zero(size, size);
    constexpr double kCorrelated = 30;  // number of places with correlated errors
    const double scale = typical_residual(), threshold = 1.5 * scale;
    noise_ = kCorrelated * scale * scale;
    for (const auto& [number, samples] : places_) {
      const Place place = place_of(samples);
      Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
      double total = 0;
      for (const ColourSample* sample : samples) {
        const double residual = (corrected(*sample) - place.colour).norm();
        const double weight = place.weight * std::min(1.0, threshold / std::max(residual, 1e-12));
        const Vector4d v = extended(sample->grey);
        normal_matrix_.block<4, 4>(4L * sample->camera, 4L * sample->camera) +=
            weight * v * v.transpose();
        row.segment<4>(4L * sample->camera) += weight * v;
        total += weight;
      }
      normal_matrix_ -= row * row.transpose() / total;
    }
  }

  /// Weights of the prior, the identity, relative to the variance of the residuals. It determines
  /// what the places do not: a green floor contains no red.
  Vector4d prior_of(int channel) const {
    const auto weight = [&](double spread) { return noise_ / (spread * spread); };
    Vector4d prior = Vector4d::Constant(weight(0.05));
    prior[channel] = weight(0.5);
    prior[3] = black_known_ ? 1e9 : weight(0.03);
    return prior;
  }

  /// Least squares with Lagrange multipliers for the mean over the cameras of each group.
  void solve_channel(int channel) {
    const int size = 4 * cameras_;
    const Vector4d unit = Vector4d::Unit(channel);
    // The block of a group has the number of a camera; a number without a group is the identity.
    Eigen::MatrixXd a = Eigen::MatrixXd::Identity(2L * size, 2L * size);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(2L * size);
    a.topLeftCorner(size, size) = normal_matrix_;
    for (int c = 0; c < cameras_; ++c) {
      a.diagonal().segment<4>(4L * c) += prior_of(channel);
      b.segment<4>(4L * c) = prior_of(channel).cwiseProduct(unit);
      const long group = size + 4L * groups_[c];
      a.block<4, 4>(group, group).setZero();
      a.block<4, 4>(4L * c, group).setIdentity();
      a.block<4, 4>(group, 4L * c).setIdentity();
      b.segment<4>(group) += unit;
    }
    const Eigen::VectorXd x = a.partialPivLu().solve(b);
    for (int c = 0; c < cameras_; ++c) {
      corrections_[c].row(channel) = x.segment<4>(4L * c).transpose();
    }
  }

  const Places& places_;
  int cameras_;
  std::vector<int> groups_;
  bool black_known_;
  std::vector<Correction> corrections_;
  Eigen::MatrixXd normal_matrix_;
  double noise_ = 0;
};

/// Subtracts the black levels, where they are known.
std::vector<ColourSample> without_black(std::span<const ColourSample> samples,
                                        const ColourOptions& options) {
  std::vector<ColourSample> result(samples.begin(), samples.end());
  if (options.black.empty()) return result;
  for (ColourSample& sample : result) sample.grey -= options.black[sample.camera];
  return result;
}

std::vector<ColourResponse> with_black(const std::vector<Correction>& corrections,
                                       const ColourOptions& options) {
  std::vector<ColourResponse> responses;
  for (size_t c = 0; c < corrections.size(); ++c) {
    responses.push_back(response_of(corrections[c]));
    if (!options.black.empty()) responses.back().black += options.black[c];
  }
  return responses;
}

// --- chart

constexpr int kWhitePatch = 18;
constexpr int kMinPatches = 12;

/// sRGB of the patches of the ColorChecker Classic, from dark skin to black (X-Rite's table).
constexpr std::array<std::array<uint8_t, 3>, 24> kChart = {
    {{115, 82, 68},   {194, 150, 130}, {98, 122, 157}, {87, 108, 67},   {133, 128, 177},
     {103, 189, 170}, {214, 126, 44},  {80, 91, 166},  {193, 90, 99},   {94, 60, 108},
     {157, 188, 64},  {224, 163, 46},  {56, 61, 150},  {70, 148, 73},   {175, 54, 60},
     {231, 199, 31},  {187, 86, 149},  {8, 133, 161},  {243, 243, 242}, {200, 200, 200},
     {160, 160, 160}, {122, 122, 121}, {85, 85, 85},   {52, 52, 52}}};

double linear_light(uint8_t srgb) {
  const double v = srgb / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

/// Mean brightness of the white patch over the cameras, relative to its true brightness.
double brightness_of(std::span<const ColourSample> samples) {
  double sum = 0;
  int count = 0;
  for (const ColourSample& sample : samples) {
    if (sample.place != kWhitePatch) continue;
    sum += sample.grey.mean() / kWhite;
    ++count;
  }
  return count > 0 ? sum / count / chart_colour(kWhitePatch).mean() : 1;
}

/// Least squares over the patches of one camera. Dark patches weigh more, as in L*.
Correction fit_camera(const std::vector<const ColourSample*>& patches, double brightness,
                      bool black_known) {
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, 3> b = Eigen::Matrix<double, 4, 3>::Zero();
  for (const ColourSample* patch : patches) {
    const Vector3d target = brightness * chart_colour(patch->place);
    const double weight = std::pow(target.mean() + 0.05, -4.0 / 3);
    const Vector4d v = extended(patch->grey);
    a += weight * v * v.transpose();
    b += weight * v * target.transpose();
  }
  if (black_known) a(3, 3) += 1e9;
  return a.ldlt().solve(b).transpose();
}

}  // namespace

bool is_well_exposed(const Vector3d& grey) { return grey.minCoeff() > 2 && grey.maxCoeff() < 246; }

Vector3d chart_colour(int patch) {
  const auto& [r, g, b] = kChart[static_cast<size_t>(patch)];
  return {linear_light(r), linear_light(g), linear_light(b)};
}

ColourFit fit_views(std::span<const ColourSample> samples, const ColourOptions& options) {
  const std::vector<ColourSample> light = without_black(samples, options);
  Places fitted = shared_places(light), held_out = shared_places(samples);
  if (std::ssize(fitted) < kMinPlaces) {
    throw InputError("colour: only " + std::to_string(fitted.size()) +
                     " well exposed places are seen by several cameras; at least " +
                     std::to_string(kMinPlaces) + " are needed");
  }
  std::erase_if(fitted, [](const auto& place) { return place.first % kHoldOutEvery == 0; });
  std::erase_if(held_out, [](const auto& place) { return place.first % kHoldOutEvery != 0; });
  ColourFit fit =
      with_differences(held_out, with_black(ViewSolver(fitted, options).solve(), options));
  fit.fitted.assign(options.cameras.size(), false);
  for (const auto& [number, seen] : fitted) {
    for (const ColourSample* sample : seen) fit.fitted[sample->camera] = true;
  }
  return fit;
}

ColourFit fit_chart(std::span<const ColourSample> samples, const ColourOptions& options) {
  const std::vector<ColourSample> light = without_black(samples, options);
  std::vector<std::vector<const ColourSample*>> by_camera(options.cameras.size());
  for (const ColourSample& sample : light) by_camera[sample.camera].push_back(&sample);
  const double brightness = brightness_of(light);
  std::vector<Correction> corrections;
  for (const auto& patches : by_camera) {
    if (std::ssize(patches) < kMinPatches) {
      throw InputError("colour: " + options.cameras[corrections.size()] + " shows " +
                       std::to_string(patches.size()) +
                       " well exposed patches of the chart; at least 12 are needed");
    }
    corrections.push_back(fit_camera(patches, brightness, !options.black.empty()));
  }
  return with_differences(shared_places(samples), with_black(corrections, options));
}

namespace {

/// One sample for each camera, the mean of all its samples; black where it has none.
std::vector<ColourSample> camera_means(std::span<const ColourSample> samples, size_t cameras) {
  std::vector<ColourSample> means(cameras);
  std::vector<int> counts(cameras, 0);
  for (const ColourSample& sample : samples) {
    means[sample.camera].grey += sample.grey;
    ++counts[sample.camera];
  }
  for (size_t c = 0; c < cameras; ++c) {
    means[c].camera = static_cast<int>(c);
    means[c].grey /= std::max(1, counts[c]);
  }
  return means;
}

}  // namespace

ColourFit fit_grey(std::span<const ColourSample> samples, const ColourOptions& options) {
  const size_t cameras = options.cameras.size();
  const std::vector<ColourSample> means = camera_means(samples, cameras);
  const std::vector<ColourSample> light = without_black(means, options);
  double target = 0;
  for (size_t c = 0; c < cameras; ++c) {
    if (!(light[c].grey.minCoeff() > 0)) {
      throw InputError("colour: " + options.cameras[c] + " shows no well exposed grey card");
    }
    target += light[c].grey.mean() / static_cast<double>(cameras);
  }
  std::vector<Correction> corrections(cameras, Correction::Zero());
  for (size_t c = 0; c < cameras; ++c) {
    corrections[c].leftCols<3>() = (target * light[c].grey.cwiseInverse()).asDiagonal();
  }
  return with_differences(shared_places(means), with_black(corrections, options));
}

namespace {

constexpr double kDegree = std::numbers::pi / 180;

double pow7(double x) { return std::pow(x, 7); }

/// Chroma and hue (degrees, 0 to 360; 0 for grey).
struct Polar {
  double chroma, hue;
};

Polar polar(double a, double b) {
  const double hue = a == 0 && b == 0 ? 0 : std::atan2(b, a) / kDegree;
  return {std::hypot(a, b), hue < 0 ? hue + 360 : hue};
}

/// Difference of two hues, -180 to 180 degrees; 0 where one colour is grey.
double hue_step(const Polar& from, const Polar& to) {
  if (from.chroma * to.chroma == 0) return 0;
  const double step = to.hue - from.hue;
  return step > 180 ? step - 360 : step < -180 ? step + 360 : step;
}

double mean_hue(const Polar& one, const Polar& two) {
  const double sum = one.hue + two.hue;
  if (one.chroma * two.chroma == 0) return sum;
  if (std::abs(one.hue - two.hue) <= 180) return sum / 2;
  return sum < 360 ? (sum + 360) / 2 : (sum - 360) / 2;
}

/// The paper's weights of a difference in lightness, chroma and hue, and its rotation term.
struct Weights {
  double lightness, chroma, hue, rotation;
};

Weights weights_at(double lightness, double chroma, double hue) {
  const auto wave = [&](double times, double less) {
    return std::cos((times * hue - less) * kDegree);
  };
  const double t =
      1 - 0.17 * wave(1, 30) + 0.24 * wave(2, 0) + 0.32 * wave(3, -6) - 0.20 * wave(4, 63);
  const double off = (lightness - 50) * (lightness - 50);
  const double turn = 60 * std::exp(-std::pow((hue - 275) / 25, 2));  // degrees, twice theta
  const double strength = 2 * std::sqrt(pow7(chroma) / (pow7(chroma) + pow7(25)));
  return {1 + 0.015 * off / std::sqrt(20 + off), 1 + 0.045 * chroma, 1 + 0.015 * chroma * t,
          -strength * std::sin(turn * kDegree)};
}

}  // namespace

Eigen::Vector3d lab_of(const Eigen::Vector3d& linear_rgb) {
  Eigen::Matrix3d xyz_from_rgb;                     // IEC 61966-2-1
  xyz_from_rgb << 0.4124564, 0.3575761, 0.1804375,  //
      0.2126729, 0.7151522, 0.0721750,              //
      0.0193339, 0.1191920, 0.9503041;
  const Eigen::Vector3d white = xyz_from_rgb * Eigen::Vector3d::Ones();
  const Eigen::Vector3d ratio = (xyz_from_rgb * linear_rgb.cwiseMax(0)).cwiseQuotient(white);
  const auto f = [](double t) {
    constexpr double kKnee = 6.0 / 29;
    return t > kKnee * kKnee * kKnee ? std::cbrt(t) : t / (3 * kKnee * kKnee) + 4.0 / 29;
  };
  const double x = f(ratio.x()), y = f(ratio.y()), z = f(ratio.z());
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

double delta_e_2000(const Eigen::Vector3d& lab1, const Eigen::Vector3d& lab2) {
  const double mean_chroma =
      0.5 * (std::hypot(lab1.y(), lab1.z()) + std::hypot(lab2.y(), lab2.z()));
  const double stretch = 1.5 - 0.5 * std::sqrt(pow7(mean_chroma) / (pow7(mean_chroma) + pow7(25)));
  const Polar one = polar(stretch * lab1.y(), lab1.z());
  const Polar two = polar(stretch * lab2.y(), lab2.z());
  const Weights w =
      weights_at(0.5 * (lab1.x() + lab2.x()), 0.5 * (one.chroma + two.chroma), mean_hue(one, two));
  const double lightness = (lab2.x() - lab1.x()) / w.lightness;
  const double chroma = (two.chroma - one.chroma) / w.chroma;
  const double hue =
      2 * std::sqrt(one.chroma * two.chroma) * std::sin(0.5 * hue_step(one, two) * kDegree) / w.hue;
  return std::sqrt(lightness * lightness + chroma * chroma + hue * hue + w.rotation * chroma * hue);
}

}  // namespace v3d::calib
