// Finds a clap in sound.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d::sound {

/// A sudden sound.
struct Clap {
  double sample = 0;   ///< of its onset
  double energy = 0;   ///< mean square of its loudest millisecond, of full scale
  double rise_db = 0;  ///< of its energy over that of the 50 ms before
};

/// Finds the loudest sound that begins suddenly, as a clap of hands or of a clapperboard: within
/// 3 ms the energy rises by kMinRiseDb over the mean of the 50 ms before. Its onset is where half
/// of its peak is reached first. Steady sounds, and sounds below -50 dB, are no claps. One thread.
class ClapFinder {
 public:
  static constexpr double kMinRiseDb = 20;

  explicit ClapFinder(int rate_hz);

  /// Adds the next samples of one channel, full scale -1 to 1.
  void push(std::span<const float> samples);
  /// The clap so far. A clap in the last 5 ms is not found.
  const std::optional<Clap>& clap() const { return clap_; }

 private:
  void add_window();
  double onset(int64_t window) const;

  const int64_t window_;       ///< samples of a millisecond
  std::vector<float> buffer_;  ///< samples from start_ on
  int64_t start_ = 0;
  std::vector<double> energies_;  ///< of the windows of buffer_
  std::optional<Clap> clap_;
};

}  // namespace v3d::sound
