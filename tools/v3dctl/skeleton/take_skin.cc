#include "v3dctl/skeleton/take_skin.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/core/statistics.h"
#include "v3dctl/motion/tracked_surfaces.h"

namespace v3d::ctl {
namespace {

constexpr size_t kMinPulses = 3;

bool is_limb(recon::Joint part) {
  using namespace recon;
  return part != kPelvis && part != kNeck && part != kHead && part != kPropBase;
}

}  // namespace

std::vector<recon::TrackedBody> read_tracked_bodies(const std::filesystem::path& file,
                                                    std::span<const int64_t> pulses) {
  TrackedSurfaces surfaces(file);
  std::vector<recon::TrackedBody> bodies(surfaces.segments().size());
  for (const TrackedSurfaces::Place& place : surfaces.places()) {
    if (!std::ranges::binary_search(pulses, place.pulse)) continue;
    recon::TrackedBody& body = bodies[place.segment];
    const codec::MotionSegmentInfo& segment = surfaces.segments()[place.segment];
    Mesh surface = surfaces.read(place);
    body.pulses.push_back(place.pulse);
    body.positions.push_back(surface.vertices);
    body.colours.push_back(surface.colours);
    const bool is_rest = place.index == segment.key || body.positions.size() == 1;
    if (!is_rest) continue;
    body.rest = body.positions.size() - 1;
    body.surface = std::move(surface);
  }
  std::erase_if(bodies, [](const auto& body) { return body.pulses.size() < kMinPulses; });
  return bodies;
}

SkinError skin_error(std::span<const recon::TrackedBody> bodies, std::span<const recon::Skin> skins,
                     const recon::KinematicStructure& structure, std::span<const int64_t> numbers) {
  std::map<int64_t, const recon::SkeletonPulse*> skeletons;
  for (const recon::SkeletonPulse& pulse : structure.pulses) {
    skeletons[numbers[pulse.index]] = &pulse;
  }
  SkinError error;
  std::vector<double> millimetres;
  for (size_t b = 0; b < bodies.size(); ++b) {
    if (skins[b].influences.empty()) continue;
    for (size_t p = 0; p < bodies[b].pulses.size(); ++p) {
      const recon::PartMotion motion =
          recon::part_motion(skins[b].rest, *skeletons.at(bodies[b].pulses[p]));
      const std::vector<Eigen::Vector3f> moved =
          recon::skinned(skins[b], motion, bodies[b].surface.vertices);
      for (size_t v = 0; v < moved.size(); ++v) {
        if (!is_limb(skins[b].influences[v].part[0])) continue;
        millimetres.push_back(1000 * double{(moved[v] - bodies[b].positions[p][v]).norm()});
      }
      ++error.pulses;
    }
  }
  if (millimetres.empty()) return error;
  error.p50_mm = percentile(millimetres, 0.5);
  error.p90_mm = percentile(millimetres, 0.9);
  return error;
}

}  // namespace v3d::ctl
