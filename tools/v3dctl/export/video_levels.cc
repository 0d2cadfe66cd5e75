#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <span>

#include "recon/texture/texture_atlas.h"
#include "v3dctl/export/volume_export.h"

namespace v3d::ctl {
namespace {

struct LevelLimits {
  const char* name;
  int number;       ///< of the level in the file and in media types
  int64_t picture;  ///< units of a picture: macroblocks of H.264, pixels of AV1
  double rate;      ///< units a second
};

// Without the levels that have the limits of the one before, but for the bit rate.
constexpr LevelLimits kH264Levels[] = {
    {"4.0", 40, 8'192, 245'760},     {"4.2", 42, 8'704, 522'240},
    {"5.0", 50, 22'080, 589'824},    {"5.1", 51, 36'864, 983'040},
    {"5.2", 52, 36'864, 2'073'600},  {"6.0", 60, 139'264, 4'177'920},
    {"6.1", 61, 139'264, 8'355'840}, {"6.2", 62, 139'264, 16'711'680},
};
constexpr LevelLimits kAv1Levels[] = {
    {"4.0", 8, 2'359'296, 70'778'880},      {"4.1", 9, 2'359'296, 141'557'760},
    {"5.0", 12, 8'912'896, 267'386'880},    {"5.1", 13, 8'912'896, 534'773'760},
    {"5.2", 14, 8'912'896, 1'069'547'520},  {"6.0", 16, 35'651'584, 1'069'547'520},
    {"6.1", 17, 35'651'584, 2'139'095'040}, {"6.2", 18, 35'651'584, 4'278'190'080},
};

/// The first level that includes pictures of so many units; null: none.
const LevelLimits* first_level(std::span<const LevelLimits> levels, int64_t picture,
                               double rate_hz) {
  const double rate = static_cast<double>(picture) * rate_hz;
  const auto found = std::ranges::find_if(levels, [&](const LevelLimits& level) {
    return picture <= level.picture && rate <= level.rate;
  });
  return found == levels.end() ? nullptr : &*found;
}

}  // namespace

std::optional<VideoLevel> h264_level(int side, double rate_hz) {
  const int64_t blocks = (side + 15) / 16;
  const LevelLimits* const level = first_level(kH264Levels, blocks * blocks, rate_hz);
  if (level == nullptr) return std::nullopt;
  return VideoLevel{level->name, fmt::format("avc1.6400{:02x}", level->number)};
}

std::optional<VideoLevel> av1_level(int side, double rate_hz) {
  const LevelLimits* const level = first_level(kAv1Levels, int64_t{side} * side, rate_hz);
  if (level == nullptr) return std::nullopt;
  return VideoLevel{level->name, fmt::format("av01.0.{:02}M.08", level->number)};
}

int max_video_side(double rate_hz) {
  int side = recon::kMaxAtlasSide;
  while (side > 2 && !(h264_level(side, rate_hz) && av1_level(side, rate_hz))) side -= 2;
  return side;
}

}  // namespace v3d::ctl
