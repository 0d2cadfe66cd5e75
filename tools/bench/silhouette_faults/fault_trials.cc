#include "silhouette_faults/fault_trials.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <random>
#include <set>

#include "base/image/mask_operations.h"
#include "recon/silhouettes/silhouette_repair.h"
#include "sim/rendering/camera_images.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr double kVoxel = 0.014;
constexpr int kTrialsOfAKind = 3;
constexpr int64_t kMinPixels = 300;
constexpr int64_t kMinSeen = 5000;
constexpr double kPeriod = 0.04;

/// Masks of all cameras at one pulse.
using Masks = std::vector<Mask>;

/// Pulses p - 2 ... p + 1; p is checked.
enum Pulse : size_t { kTwoBefore, kBefore, kNow, kAfter, kPulses };

struct Instant {
  std::array<Masks, kPulses> truth;
  std::vector<Frame> frames, frames_before;
};

Masks true_masks(const Rig& rig, double seconds, uint64_t seed) {
  Masks masks;
  for (const RigCamera& camera : rig) {
    masks.push_back(sim::true_silhouette(camera, seconds, seed));
  }
  return masks;
}

std::vector<Frame> pictures(const Rig& rig, sim::BatchRenderer& film, double seconds, int number) {
  std::vector<Frame> frames;
  std::vector<Image> images = film.render_all(seconds, static_cast<uint64_t>(number));
  for (size_t c = 0; c < rig.size(); ++c) {
    Frame frame;
    frame.camera = rig[c].name;
    frame.sensor_size = kSize;
    frame.roi = {0, 0, kSize.width, kSize.height};
    frame.image = std::move(images[c]);
    frames.push_back(std::move(frame));
  }
  return frames;
}

Instant make_instant(const Rig& rig, sim::BatchRenderer& film, double seconds, int number,
                     uint64_t seed) {
  Instant instant;
  for (size_t p = 0; p < kPulses; ++p) {
    const double offset = kPeriod * (static_cast<int>(p) - static_cast<int>(kNow));
    instant.truth[p] = true_masks(rig, seconds + offset, seed);
  }
  instant.frames = pictures(rig, film, seconds, 2 * number);
  instant.frames_before = pictures(rig, film, seconds - kPeriod, 2 * number + 1);
  return instant;
}

/// Masks of a trial, and the images that belong to them.
struct Shown {
  std::array<Masks, kPulses> masks;
  std::vector<const Frame*> frames;
};

Shown as_it_is(const Instant& instant) {
  Shown shown{.masks = instant.truth, .frames = {}};
  for (const Frame& frame : instant.frames) shown.frames.push_back(&frame);
  return shown;
}

int below(std::mt19937& random, int count) {
  return static_cast<int>(random() % static_cast<uint32_t>(count));
}

std::pair<int, int> position_in(const Mask& mask, std::mt19937& random) {
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

/// Adds a fault to one camera, at a random position.
using AddFault = void (*)(const Instant&, size_t camera, std::mt19937& random, Shown& shown);

void punch_hole(const Instant& instant, size_t camera, std::mt19937& random, Shown& shown) {
  const auto [x, y] = position_in(instant.truth[kNow][camera], random);
  const Mask hole = disc(x, y, 10 + below(random, 15));
  for (Masks& masks : shown.masks) masks[camera] = difference_of(std::move(masks[camera]), hole);
}

void add_blob(const Instant& instant, size_t camera, std::mt19937& random, Shown& shown) {
  const auto [x, y] = position_in(instant.truth[kNow][camera], random);
  const Mask blob = disc(x + 30, y, 15 + below(random, 20));
  for (Masks& masks : shown.masks) masks[camera] = union_of(std::move(masks[camera]), blob);
}

/// Removes a third of the width and a quarter of the height, at one side.
void lose_limb(const Instant& instant, size_t camera, std::mt19937& random, Shown& shown) {
  const Rect box = instant.truth[kNow][camera].bounding_box();
  const int y0 = box.y0 + below(random, 3 * box.height / 4);
  const int x0 = below(random, 2) == 0 ? box.x0 : box.x0 + 2 * box.width / 3;
  Mask limb(kSize);
  for (int y = y0; y < y0 + box.height / 4; ++y) limb.fill_row(y, x0, x0 + box.width / 3);
  for (Masks& masks : shown.masks) masks[camera] = difference_of(std::move(masks[camera]), limb);
}

void blacken(const Instant&, size_t camera, std::mt19937&, Shown& shown) {
  for (Masks& masks : shown.masks) masks[camera] = Mask(kSize);
}

void make_late(const Instant& instant, size_t camera, std::mt19937&, Shown& shown) {
  for (size_t p = 1; p < kPulses; ++p) shown.masks[p][camera] = instant.truth[p - 1][camera];
  shown.frames[camera] = &instant.frames_before[camera];
}

void repeat(const Instant& instant, size_t camera, std::mt19937&, Shown& shown) {
  shown.masks[kNow][camera] = instant.truth[kBefore][camera];
  shown.frames[camera] = &instant.frames_before[camera];
}

struct Kind {
  const char* name;
  AddFault add_fault;
};
constexpr Kind kKinds[] = {{"hole", punch_hole},          {"blob", add_blob},
                           {"lost limb", lose_limb},      {"black camera", blacken},
                           {"one pulse late", make_late}, {"frame repeated", repeat}};

int64_t differing(const Mask& a, const Mask& b) {
  return difference_of(a, b).count() + difference_of(b, a).count();
}

/// All trials of one studio.
class Trials {
 public:
  Trials(uint64_t seed, bool list)
      : seed_(seed),
        list_(list),
        rig_(sim::make_rig(kCameras, kSize, seed)),
        film_(rig_, {.seed = seed}),
        random_(static_cast<uint32_t>(seed)),
        repair_(rig_, space(), kVoxel, kMinViews),
        intersector_(recon::VoxelGrid::covering(space(), kVoxel), models_of(rig_), kMinViews) {}

  void run(int pulse, std::vector<FaultScore>& scores) {
    const Instant instant = make_instant(rig_, film_, 0.13 + 0.31 * pulse, pulse, seed_);
    if (list_)
      std::printf("seed %llu, instant %d\n", static_cast<unsigned long long>(seed_), pulse);
    judge(instant, as_it_is(instant), std::nullopt, scores[0]);
    for (size_t k = 0; k < std::size(kKinds); ++k) try_kind(instant, kKinds[k], scores[k + 1]);
  }

 private:
  void try_kind(const Instant& instant, const Kind& kind, FaultScore& score) {
    for (int n = 0; n < kTrialsOfAKind; ++n) {
      const size_t camera = random_() % rig_.size();
      if (instant.truth[kNow][camera].count() < kMinSeen) continue;
      Shown shown = as_it_is(instant);
      kind.add_fault(instant, camera, random_, shown);
      const int64_t changed = differing(instant.truth[kNow][camera], shown.masks[kNow][camera]);
      if (changed >= kMinPixels) judge(instant, shown, camera, score);
    }
  }

  void judge(const Instant& instant, const Shown& shown, std::optional<size_t> faulty,
             FaultScore& score) {
    const recon::RepairedSilhouettes repaired = repair_.repair(
        pointers_to(shown.masks[kNow]), shown.frames,
        {.before = pointers_to(shown.masks[kBefore]), .after = pointers_to(shown.masks[kAfter])});
    std::vector<const Mask*> after;
    for (const auto& mask : repaired.masks) after.push_back(mask ? &*mask : nullptr);
    const recon::SparseVolume truth = intersector_.intersect(pointers_to(instant.truth[kNow]));
    const int64_t wrong_before =
        count_differing(intersector_.intersect(pointers_to(shown.masks[kNow])), truth);
    const int64_t wrong_after = count_differing(intersector_.intersect(after), truth);
    std::set<size_t> named;
    for (const recon::SilhouetteFault& fault : repaired.faults) named.insert(fault.camera);
    const bool found = faulty && named.contains(*faulty);
    ++score.trials;
    score.found += found;
    score.innocent += std::ssize(rig_) - (faulty ? 1 : 0);
    score.false_alarms += std::ssize(named) - (found ? 1 : 0);
    score.wrong_before += wrong_before;
    score.wrong_after += wrong_after;
    if (list_) print(score.kind, faulty, found, wrong_before, wrong_after, repaired.faults);
  }

  void print(const std::string& kind, std::optional<size_t> faulty, bool found,
             int64_t wrong_before, int64_t wrong_after,
             const std::vector<recon::SilhouetteFault>& faults) const {
    std::printf("  %-16s %-6s %-6s %9lld %9lld\n", kind.c_str(),
                faulty ? rig_[*faulty].name.c_str() : "",
                !faulty ? ""
                : found ? "found"
                        : "missed",
                static_cast<long long>(wrong_before), static_cast<long long>(wrong_after));
    for (const recon::SilhouetteFault& fault : faults) {
      static constexpr const char* kNames[] = {"missing", "phantom", "whole", "late"};
      std::printf("      %s%s %s %d,%d %dx%d %lld px\n", rig_[fault.camera].name.c_str(),
                  fault.camera == faulty ? "" : " (innocent)",
                  kNames[static_cast<size_t>(fault.kind)], fault.region.x0, fault.region.y0,
                  fault.region.width, fault.region.height, static_cast<long long>(fault.pixels));
    }
  }

  const uint64_t seed_;
  const bool list_;
  const Rig rig_;
  sim::BatchRenderer film_;
  std::mt19937 random_;
  recon::SilhouetteRepair repair_;
  recon::Intersector intersector_;
};

}  // namespace

std::vector<FaultScore> try_faults(const FaultTrialOptions& options) {
  std::vector<FaultScore> scores{{.kind = "none"}};
  for (const Kind& kind : kKinds) scores.push_back({.kind = kind.name});
  for (int n = 0; n < options.studios; ++n) {
    Trials trials(options.first_seed + static_cast<uint64_t>(n), options.list);
    for (int pulse = 0; pulse < options.pulses; ++pulse) trials.run(pulse, scores);
  }
  return scores;
}

}  // namespace v3d::bench
