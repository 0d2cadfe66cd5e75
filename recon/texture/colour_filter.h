// Temporal filter of colours: less noise at places of a surface that are followed over the pulses.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

/// Steadies the colours of successive pulses at the same places, such as texels of one layout or
/// vertices of one tracked surface. A place follows small changes, such as noise and cameras that
/// fade in and out, by a seventh a pulse. It follows changes of 40 grey values or more at once, so
/// that no wrong colour stays. A place that no camera sees any more keeps its colour, and one that
/// a camera sees for the first time has that colour at once. One thread.
class ColourFilter {
 public:
  /// Replaces the colours of the next pulse: red, green and blue of each place. `seen`: for each
  /// place, 0 where no camera sees it. All pulses have the same places.
  void apply(std::span<uint8_t> colours, std::span<const uint8_t> seen);
  /// The same for the vertices of a surface. A pulse without colours is left out.
  void apply(std::vector<Rgb8>& colours, std::span<const uint8_t> seen);

 private:
  std::vector<float> shown_;  ///< red, green and blue of every place so far
  std::vector<uint8_t> was_seen_;
};

}  // namespace v3d::recon
