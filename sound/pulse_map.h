// Piecewise linear map of pulse numbers to positions of samples.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace v3d::sound {

/// Maps the pulses of a take to positions in a sound file: linear between knots, and extended
/// beyond the first and the last with the slope there.
struct PulseMap {
  struct Knot {
    double pulse = 0;
    double sample = 0;
    friend bool operator==(const Knot&, const Knot&) = default;
  };
  /// Both coordinates ascend strictly.
  std::vector<Knot> knots;

  friend bool operator==(const PulseMap&, const PulseMap&) = default;

  /// True with two knots or more. The functions below require it.
  bool is_known() const { return knots.size() >= 2; }
  /// Position of the sample at the leading edge of a pulse. May be outside of the file.
  double sample_of(double pulse) const;
  /// The inverse: pulse 2.5 is half a period after the edge of pulse 2.
  double pulse_of(double sample) const;
};

/// Builds a map from points, without keeping them: every added point is within tolerance() of the
/// map. Points must ascend in both coordinates, and behind a gap be above its end; others are
/// ignored.
///
/// Source: Bristol, "Swinging door trending: adaptive trend recording?", ISA National Conference
/// 1990; the knots here lie within the door, not on points. When the most knots are reached, the
/// tolerance is doubled, until half of them are enough. One thread.
class PulseMapBuilder {
 public:
  static constexpr size_t kMaxKnots = 20'000;

  /// `tolerance`: samples. `max_knots`: 4 or more; map() has at most one more.
  explicit PulseMapBuilder(double tolerance, size_t max_knots = kMaxKnots)
      : tolerance_(tolerance), max_knots_(max_knots) {}

  void add(const PulseMap::Knot& point);
  /// Ends the line at the last point, extended to sample `end` with `slope`, samples per pulse. The
  /// first point after it is extended back to sample `begin`.
  void add_gap(double end, double begin, double slope);
  /// The map of all points.
  PulseMap map() const;
  /// Samples; grows with the number of knots.
  double tolerance() const { return tolerance_; }
  int64_t points() const { return points_; }
  /// Samples per pulse over all lines, gaps excluded; 0 without a line.
  double slope() const;

 private:
  struct Gap {
    double begin = 0;
    double slope = 0;
  };

  bool is_after_gap(const PulseMap::Knot& point) const;
  void start_line(const PulseMap::Knot& point);
  bool extend_door(const PulseMap::Knot& point);
  PulseMap::Knot end_of_line() const;
  void push(const PulseMap::Knot& knot);
  void thin_out();

  double tolerance_;
  size_t max_knots_;
  std::vector<PulseMap::Knot> knots_;  ///< the last is the anchor of the open line
  bool has_line_ = false;              ///< the open line has a point besides its anchor
  PulseMap::Knot last_;                ///< the last point
  double min_slope_ = 0, max_slope_ = 0;
  bool in_gap_ = false;
  Gap gap_;
  int64_t points_ = 0;
  PulseMap::Knot covered_;  ///< pulses and samples of all closed lines
};

}  // namespace v3d::sound
