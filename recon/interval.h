// Bounds of what a float computation can give.
#pragma once

#include <algorithm>
#include <limits>

namespace v3d {

/// All floats from lo to hi. Each operation bounds the *rounded* results of the same float
/// operation on members of its operands: rounding to nearest is monotone, so the rounded result at
/// an end point bounds the rounded results inside, and nothing needs to be padded. Holds only while
/// the compiler does not contract a multiply and an add (-ffp-contract=off). Where an end point
/// would be no number, the interval is everything.
struct Interval {
  float lo = 0;
  float hi = 0;

  Interval() = default;
  Interval(float value) : lo(value), hi(value) {}  // NOLINT: constants mix with intervals
  Interval(float low, float high) : lo(low), hi(high) {}
  static Interval everything() {
    return {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};
  }
};

inline Interval operator+(Interval a, Interval b) {
  const Interval sum(a.lo + b.lo, a.hi + b.hi);
  return sum.lo <= sum.hi ? sum : Interval::everything();
}

inline Interval operator*(float a, Interval b) {
  const float p = a * b.lo;
  const float q = a * b.hi;
  const Interval product(std::min(p, q), std::max(p, q));
  return p + q == p + q ? product : Interval::everything();
}

inline Interval operator*(Interval a, Interval b) {
  const float p = a.lo * b.lo;
  const float q = a.lo * b.hi;
  const float r = a.hi * b.lo;
  const float s = a.hi * b.hi;
  const float sum = (p + q) + (r + s);
  if (sum != sum) return Interval::everything();
  return {std::min(std::min(p, q), std::min(r, s)), std::max(std::max(p, q), std::max(r, s))};
}

inline Interval square(Interval a) {
  const float p = a.lo * a.lo;
  const float q = a.hi * a.hi;
  const bool has_zero = a.lo <= 0 && a.hi >= 0;
  return {has_zero ? 0.0F : std::min(p, q), std::max(p, q)};
}

inline Interval reciprocal(Interval a) {
  if (a.lo <= 0 && a.hi >= 0) return Interval::everything();
  return {1.0F / a.hi, 1.0F / a.lo};
}

}  // namespace v3d
