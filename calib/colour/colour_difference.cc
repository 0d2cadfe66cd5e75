#include "calib/colour/colour_difference.h"

#include <cmath>
#include <numbers>

namespace v3d::calib {
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
