#include "mask_noise/damage.h"

#include <algorithm>

#include "base/image/mask_morphology.h"

namespace v3d::bench {
namespace {

constexpr double kSalt = 0.05;     // part of all pixels that are inverted
constexpr double kFrayed = 0.5;    // part of the outline's pixels that are lost
constexpr int kHoles = 12;         // small holes in each silhouette
constexpr int kMaxHoleRadius = 4;  // pixels

int below(std::mt19937& random, int count) {
  return static_cast<int>(random() % static_cast<uint32_t>(count));
}
bool happens(std::mt19937& random, double part) {
  return static_cast<double>(random()) < part * 4294967296.0;
}

template <class Change>
void for_every_pixel(const Mask& mask, Change change) {
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) change(x, y);
  }
}

void cut_disc(Mask& mask, int u, int v, int radius) {
  for (int y = std::max(0, v - radius); y <= std::min(mask.size().height - 1, v + radius); ++y) {
    for (int x = std::max(0, u - radius); x <= std::min(mask.size().width - 1, u + radius); ++x) {
      if ((x - u) * (x - u) + (y - v) * (y - v) <= radius * radius) mask.set(x, y, false);
    }
  }
}

void leave_alone(Mask&, std::mt19937&) {}

void salt(Mask& mask, std::mt19937& random) {
  for_every_pixel(mask, [&](int x, int y) {
    if (happens(random, kSalt)) mask.set(x, y, !mask.get(x, y));
  });
}

void fray(Mask& mask, std::mt19937& random) {
  const Mask core = erode(mask, 1);
  for_every_pixel(mask, [&](int x, int y) {
    if (mask.get(x, y) && !core.get(x, y) && happens(random, kFrayed)) mask.set(x, y, false);
  });
}

void punch_small_holes(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  for (int n = 0; n < kHoles && !box.empty(); ++n) {
    const int u = box.x0 + below(random, box.width);
    const int v = box.y0 + below(random, box.height);
    cut_disc(mask, u, v, 1 + below(random, kMaxHoleRadius));
  }
}

void apply_all_three(Mask& mask, std::mt19937& random) {
  punch_small_holes(mask, random);
  fray(mask, random);
  salt(mask, random);
}

void erode_by_a_pixel(Mask& mask, std::mt19937&) { mask = erode(mask, 1); }

/// Cuts a disc around a random pixel of the silhouette. Its diameter is a tenth to a fifth of the
/// shorter side.
void punch_big_hole(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  if (box.empty()) return;
  const int edge = std::min(box.width, box.height);
  for (;;) {
    const int u = box.x0 + below(random, box.width);
    const int v = box.y0 + below(random, box.height);
    if (!mask.get(u, v)) continue;
    return cut_disc(mask, u, v, edge / 20 + below(random, edge / 20 + 1));
  }
}

/// Removes a third of the width and a quarter of the height, at one side.
void lose_limb(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  if (box.empty()) return;
  const int y0 = box.y0 + below(random, 3 * box.height / 4);
  const int x0 = below(random, 2) == 0 ? box.x0 : box.x0 + 2 * box.width / 3;
  Mask limb(mask.size());
  for (int y = y0; y < y0 + box.height / 4; ++y) limb.fill_row(y, x0, x0 + box.width / 3);
  mask = difference_of(std::move(mask), limb);
}

void lose_half(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  const int y0 = below(random, 2) == 0 ? box.y0 : box.y0 + box.height / 2;
  Mask half(mask.size());
  for (int y = y0; y < y0 + box.height / 2; ++y) half.fill_row(y, box.x0, box.x0 + box.width);
  mask = difference_of(std::move(mask), half);
}

void blacken(Mask& mask, std::mt19937&) { mask = Mask(mask.size()); }

constexpr Damage kDamages[] = {
    {"none", true, leave_alone},
    {"salt and pepper, 5 % of all pixels", true, salt},
    {"frayed: every second outline pixel lost", true, fray},
    {"12 holes of 1 to 4 pixels' radius", true, punch_small_holes},
    {"all three", true, apply_all_three},
    {"eroded by a pixel", true, erode_by_a_pixel},
    {"big hole, a quarter of the cameras", false, punch_big_hole},
    {"lost limb, a quarter of the cameras", false, lose_limb},
    {"lost half, a quarter of the cameras", false, lose_half},
    {"black, a quarter of the cameras", false, blacken},
};

}  // namespace

std::span<const Damage> all_damages() { return kDamages; }

}  // namespace v3d::bench
