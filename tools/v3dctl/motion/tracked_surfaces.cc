#include "v3dctl/motion/tracked_surfaces.h"

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d::ctl {

TrackedSurfaces::TrackedSurfaces(const std::filesystem::path& file)
    : file_(file), bytes_(read_file(file)) {
  reader_ =
      codec::MotionReader::open({reinterpret_cast<const uint8_t*>(bytes_.data()), bytes_.size()});
  if (!reader_) damaged();
}

std::vector<TrackedSurfaces::Place> TrackedSurfaces::places() const {
  std::vector<Place> places;
  for (size_t s = 0; s < segments().size(); ++s) {
    const std::vector<int64_t>& pulses = segments()[s].pulses;
    for (size_t i = 0; i < pulses.size(); ++i) places.push_back({s, i, pulses[i]});
  }
  return places;
}

Mesh TrackedSurfaces::read(const Place& place) {
  const codec::MotionTemplate* const surface = reader_->surface(place.segment);
  const codec::MotionPulse* const pulse =
      surface != nullptr ? reader_->decode(place.segment, place.index) : nullptr;
  if (pulse == nullptr) damaged();
  Mesh mesh;
  mesh.triangles = surface->triangles;
  for (const auto& [x, y, z] : pulse->positions) mesh.vertices.emplace_back(x, y, z);
  for (const auto& [r, g, b] : pulse->colours) mesh.colours.push_back({r, g, b});
  return mesh;
}

void TrackedSurfaces::damaged() const {
  throw InputError(file_.string() + ": is damaged: run v3dctl track again");
}

}  // namespace v3d::ctl
