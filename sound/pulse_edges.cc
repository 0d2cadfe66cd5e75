#include "sound/pulse_edges.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/core/statistics.h"

namespace v3d::sound {
namespace {

double windowed_sinc(double x) {
  if (std::abs(x) < 1e-9) return 1;
  if (std::abs(x) >= kKernel) return 0;
  const double angle = std::numbers::pi * x;
  return std::sin(angle) / angle * (0.5 + 0.5 * std::cos(angle / kKernel));
}

}  // namespace

std::array<double, 2 * kKernel> interpolation_weights(double position) {
  const double first = std::floor(position) - kKernel + 1;
  std::array<double, 2 * kKernel> weights{};
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = windowed_sinc(position - first - static_cast<double>(i));
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

double interpolate(std::span<const float> samples, double index) {
  const auto weights = interpolation_weights(index);
  const auto first = static_cast<int64_t>(std::floor(index)) - kKernel + 1;
  double sum = 0;
  for (int64_t i = 0; i < std::ssize(weights); ++i) {
    const int64_t inside = std::clamp<int64_t>(first + i, 0, std::ssize(samples) - 1);
    sum += weights[static_cast<size_t>(i)] * samples[static_cast<size_t>(inside)];
  }
  return sum;
}

namespace {

/// Excursions smaller than this share of full scale (-50 dB) are no pulses.
constexpr double kMinHeight = 0.003;
/// Excursions end within this many standard deviations of the noise.
constexpr double kNoiseLimit = 6;
/// The median absolute deviation of a normal distribution, as a standard deviation.
constexpr double kDeviationPerMedian = 1.4826;
/// Pulses whose height changes by more than this factor from one window to the next are checked in
/// a second window.
constexpr double kMaxHeightChange = 3;
constexpr double kVoteDecay = 0.8;

}  // namespace

PulseEdgeDetector::PulseEdgeDetector(int rate_hz) : window_(rate_hz / 2) {}

std::vector<double> PulseEdgeDetector::push(std::span<const float> samples) {
  buffer_.insert(buffer_.end(), samples.begin(), samples.end());
  std::vector<double> edges;
  while (std::ssize(buffer_) >= next_ + window_ + kKernel) search_window(next_ + window_, edges);
  return edges;
}

std::vector<double> PulseEdgeDetector::finish() {
  std::vector<double> edges;
  if (next_ < std::ssize(buffer_)) search_window(std::ssize(buffer_), edges);
  return edges;
}

void PulseEdgeDetector::search_window(int64_t end, std::vector<double>& edges) {
  // Levels are measured over a longer window, which has the pulses at its border whole.
  const int64_t history = window_ + window_ / 4;
  const int64_t begin = std::max<int64_t>(0, end - history);
  const Levels levels = levels_of(begin, end);
  if (measure_pulses(excursions(levels, begin, end))) {
    find_edges(levels.idle, end, edges);
  } else {
    is_high_ = false;
  }
  buffer_.erase(buffer_.begin(), buffer_.begin() + begin);
  start_ += begin;
  next_ = end - begin;
}

PulseEdgeDetector::Levels PulseEdgeDetector::levels_of(int64_t begin, int64_t end) const {
  std::vector<float> values(buffer_.begin() + begin, buffer_.begin() + end);
  const float idle = upper_median(values);
  for (float& value : values) value = std::abs(value - idle);
  return {.idle = idle, .noise = kDeviationPerMedian * upper_median(std::move(values))};
}

std::vector<PulseEdgeDetector::Excursion> PulseEdgeDetector::excursions(const Levels& levels,
                                                                        int64_t begin,
                                                                        int64_t end) const {
  const double limit = std::max(kMinHeight, kNoiseLimit * levels.noise);
  std::vector<Excursion> found;
  std::vector<double> heights;
  int side = 0;
  int64_t run = 0;  // samples on this side
  for (int64_t i = begin; i <= end; ++i) {
    const double distance = i < end ? buffer_[static_cast<size_t>(i)] - levels.idle : 0;
    const int now = distance > limit ? 1 : distance < -limit ? -1 : 0;
    if (now != side && side != 0) {
      const double half = *std::ranges::max_element(heights) / 2;
      std::erase_if(heights, [&](double height) { return height < half; });
      const bool is_cut = i == end || i - begin == run;
      found.push_back({.side = side,
                       .height = median(heights),
                       .samples = std::ssize(heights),
                       .is_cut = is_cut});
      heights.clear();
    }
    run = now == side ? run + 1 : 1;
    side = now;
    if (side != 0) heights.push_back(std::abs(distance));
  }
  return found;
}

bool PulseEdgeDetector::measure_pulses(std::vector<Excursion> found) {
  const bool has_pulses = !found.empty();
  std::erase_if(found, [](const Excursion& e) { return e.is_cut; });
  if (found.empty()) return has_pulses && height_ > 0;
  double up = 0, down = 0;
  for (const Excursion& e : found) {
    (e.side > 0 ? up : down) += e.height * static_cast<double>(e.samples);
  }
  side_votes_ = kVoteDecay * side_votes_ + (up - down) / (up + down);
  // The median height, weighted by area: clicks and ringing are short or low.
  std::vector<std::pair<double, double>> areas;  // height, area
  double total = 0;
  for (const Excursion& e : found) {
    if ((e.side > 0) != (side_votes_ > 0)) continue;
    areas.emplace_back(e.height, e.height * static_cast<double>(e.samples));
    total += areas.back().second;
  }
  if (areas.empty()) return false;
  std::ranges::sort(areas);
  double below = 0;
  size_t middle = 0;
  while ((below += areas[middle].second) < total / 2) ++middle;
  const double height = areas[middle].first;
  const double change = height_ == 0 ? 1 : std::max(height / height_, height_ / height);
  if (change > kMaxHeightChange && ++strange_windows_ < 2) return false;
  strange_windows_ = 0;
  height_ = height;
  return true;
}

void PulseEdgeDetector::find_edges(double idle, int64_t end, std::vector<double>& edges) {
  const double side = side_votes_ > 0 ? 1 : -1;
  for (int64_t i = next_; i < end; ++i) {
    const double height = side * (buffer_[static_cast<size_t>(i)] - idle);
    if (is_high_) {
      is_high_ = height >= 0.25 * height_;
    } else if (height >= 0.5 * height_) {
      is_high_ = true;
      if (i > 0) {
        edges.push_back(static_cast<double>(start_) + crossing(i, idle + side * 0.5 * height_));
      }
    }
  }
}

double PulseEdgeDetector::crossing(int64_t index, double threshold) const {
  double low = static_cast<double>(index - 1), high = static_cast<double>(index);
  const bool rises = buffer_[static_cast<size_t>(index)] > buffer_[static_cast<size_t>(index - 1)];
  constexpr int kHalvings = 12;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    ((interpolate(buffer_, middle) < threshold) == rises ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace v3d::sound
