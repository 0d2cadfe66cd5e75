#include "silhouette_faults/fault_trials.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <random>

#include "base/mask_shape.h"
#include "recon/silhouette_mender.h"
#include "sim/film.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr double kVoxel = 0.014;
constexpr int kTrialsOfAKind = 3;
constexpr int64_t kLeastPixels = 300;
constexpr int64_t kLeastSeen = 5000;
constexpr double kPeriod = 0.04;

struct Instant {
  std::vector<Mask> masks;   ///< true
  std::vector<Mask> before;  ///< true, a pulse earlier
  std::vector<Frame> frames;
};

Instant make_instant(sim::Film& film, double seconds, int number) {
  Instant instant;
  std::vector<Image> images = film.shoot_all(seconds, static_cast<uint64_t>(number));
  for (size_t c = 0; c < rig().size(); ++c) {
    instant.masks.push_back(sim::true_silhouette(rig()[c], seconds, kSeed));
    instant.before.push_back(sim::true_silhouette(rig()[c], seconds - kPeriod, kSeed));
    Frame frame;
    frame.camera = rig()[c].name;
    frame.sensor_size = kSize;
    frame.roi = {0, 0, kSize.width, kSize.height};
    frame.image = std::move(images[c]);
    instant.frames.push_back(std::move(frame));
  }
  return instant;
}

/// Puts a fault into one mask; `random` chooses where.
using Spoil = Mask (*)(const Instant&, size_t camera, std::mt19937& random);

int below(std::mt19937& random, int count) {
  return static_cast<int>(random() % static_cast<uint32_t>(count));
}

std::pair<int, int> place_in(const Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  for (;;) {
    const int x = box.x0 + below(random, box.width);
    const int y = box.y0 + below(random, box.height);
    if (mask.get(x, y)) return {x, y};
  }
}

Mask disc(int x, int y, int radius) {
  Mask mask(kSize);
  for (int v = std::max(0, y - radius); v <= std::min(kSize.height - 1, y + radius); ++v) {
    for (int u = std::max(0, x - radius); u <= std::min(kSize.width - 1, x + radius); ++u) {
      const int du = u - x, dv = v - y;
      if (du * du + dv * dv <= radius * radius) mask.set(u, v);
    }
  }
  return mask;
}

Mask with_hole(const Instant& instant, size_t camera, std::mt19937& random) {
  const auto [x, y] = place_in(instant.masks[camera], random);
  return only_first(instant.masks[camera], disc(x, y, 10 + below(random, 15)));
}

Mask with_blob(const Instant& instant, size_t camera, std::mt19937& random) {
  const auto [x, y] = place_in(instant.masks[camera], random);
  return either(instant.masks[camera], disc(x + 30, y, 15 + below(random, 20)));
}

/// A third of the width and a quarter of the height, at one side.
Mask without_limb(const Instant& instant, size_t camera, std::mt19937& random) {
  const Rect box = instant.masks[camera].bounding_box();
  const int y0 = box.y0 + below(random, 3 * box.height / 4);
  const int x0 = below(random, 2) == 0 ? box.x0 : box.x0 + 2 * box.width / 3;
  Mask limb(kSize);
  for (int y = y0; y < y0 + box.height / 4; ++y) limb.fill_row(y, x0, x0 + box.width / 3);
  return only_first(instant.masks[camera], limb);
}

Mask black(const Instant&, size_t, std::mt19937&) { return Mask(kSize); }
Mask late(const Instant& instant, size_t camera, std::mt19937&) { return instant.before[camera]; }

struct Kind {
  const char* name;
  Spoil spoil;
};
constexpr Kind kKinds[] = {{"hole", with_hole},
                           {"blob", with_blob},
                           {"lost limb", without_limb},
                           {"black camera", black},
                           {"one pulse late", late}};

int64_t differing(const SparseVolume& a, const SparseVolume& b) {
  int64_t common = 0;
  for (size_t n = 0; n < a.bricks().size(); ++n) {
    const int other = b.index_of(a.coords()[n]);
    for (int z = 0; other >= 0 && z < kBrickEdge; ++z) {
      common += std::popcount(a.bricks()[n][z] & b.bricks()[other][z]);
    }
  }
  return a.count() + b.count() - 2 * common;
}

class Trials {
 public:
  Trials() : mender_(rig(), space(), kVoxel, kMinViews), intersector_(intersector(kVoxel)) {}

  /// The faults that are found in these masks; adds to the voxels that are wrong.
  std::vector<SilhouetteFault> judge(const Instant& instant, const std::vector<Mask>& masks,
                                     FaultScore& score) {
    std::vector<const Frame*> frames;
    for (const Frame& frame : instant.frames) frames.push_back(&frame);
    MendedSilhouettes mended = mender_.mend(pointers_to(masks), frames);
    std::vector<const Mask*> after;
    for (const auto& mask : mended.masks) after.push_back(mask ? &*mask : nullptr);
    const SparseVolume truth = intersector_.intersect(pointers_to(instant.masks));
    score.wrong_before += differing(intersector_.intersect(pointers_to(masks)), truth);
    score.wrong_after += differing(intersector_.intersect(after), truth);
    ++score.trials;
    return std::move(mended.faults);
  }

 private:
  SilhouetteMender mender_;
  Intersector intersector_;
};

void try_kind(const Instant& instant, const Kind& kind, std::mt19937& random, Trials& trials,
              FaultScore& score) {
  for (int n = 0; n < kTrialsOfAKind; ++n) {
    const size_t camera = random() % rig().size();
    const Mask& truth = instant.masks[camera];
    if (truth.count() < kLeastSeen) continue;
    std::vector<Mask> masks = instant.masks;
    masks[camera] = kind.spoil(instant, camera, random);
    const int64_t changed =
        only_first(truth, masks[camera]).count() + only_first(masks[camera], truth).count();
    if (changed < kLeastPixels) continue;
    const auto faults = trials.judge(instant, masks, score);
    const auto of_camera = [&](const SilhouetteFault& fault) { return fault.camera == camera; };
    score.found += std::ranges::any_of(faults, of_camera);
    score.false_alarms += static_cast<int>(std::ranges::count_if(faults, std::not_fn(of_camera)));
  }
}

}  // namespace

std::vector<FaultScore> try_faults(int pulses) {
  std::vector<FaultScore> scores{{.kind = "none"}};
  for (const Kind& kind : kKinds) scores.push_back({.kind = kind.name});
  sim::Film film(rig(), {.seed = kSeed});
  std::mt19937 random(7);
  Trials trials;
  for (int pulse = 0; pulse < pulses; ++pulse) {
    const Instant instant = make_instant(film, 0.13 + 0.31 * pulse, pulse);
    scores[0].false_alarms +=
        static_cast<int>(trials.judge(instant, instant.masks, scores[0]).size());
    for (size_t k = 0; k < std::size(kKinds); ++k) {
      try_kind(instant, kKinds[k], random, trials, scores[k + 1]);
    }
  }
  return scores;
}

}  // namespace v3d::bench
