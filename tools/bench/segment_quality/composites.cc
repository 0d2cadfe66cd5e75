#include <algorithm>
#include <cmath>
#include <numbers>

#include "segment_quality/segment_trials.h"
#include "sim/rendering/noise.h"
#include "v3dctl/import/media.h"

namespace v3d::bench {
namespace {

constexpr uint64_t kSeed = 20090219;
constexpr const char* kRooms[] = {"cam1", "cam2", "cam3", "cam4"};
constexpr const char* kPeople[] = {"cam00", "cam04", "cam09", "cam13"};
constexpr double kStanding[] = {0.28, 0.5, 0.72};  ///< feet, as parts of the room's width
constexpr double kFeet = 0.94;  ///< position of the feet, part of the room's height
constexpr int kMaxPlates = 40;

/// Image of a person: colour (red, green, blue) and coverage (0 to 1) of every pixel.
struct Cutout {
  ImageSize size;
  std::vector<float> colour;
  std::vector<float> cover;

  float cover_at(double x, double y) const {
    const auto u = static_cast<int>(std::lround(x));
    const auto v = static_cast<int>(std::lround(y));
    if (u < 0 || v < 0 || u >= size.width || v >= size.height) return 0;
    return cover[static_cast<size_t>(v) * size.width + u];
  }
};

/// The mask without its outermost pixels, which mix with the studio's black walls.
Mask without_rim(const Mask& mask) {
  constexpr int kRim = 2;
  Mask inner(mask.size());
  for (int y = kRim; y < mask.size().height - kRim; ++y) {
    for (int x = kRim; x < mask.size().width - kRim; ++x) {
      inner.set(x, y,
                mask.get(x, y) && mask.get(x - kRim, y) && mask.get(x + kRim, y) &&
                    mask.get(x, y - kRim) && mask.get(x, y + kRim));
    }
  }
  return inner;
}

/// Reduces to half size: the mean of the person's pixels in each block of 2 x 2.
Cutout halved(const Image& image, const Mask& mask, Rect box) {
  Cutout cutout{{box.width / 2, box.height / 2}, {}, {}};
  cutout.colour.resize(3 * cutout.size.pixels());
  cutout.cover.resize(cutout.size.pixels());
  for (size_t n = 0; n < cutout.cover.size(); ++n) {
    const int x0 = box.x0 + 2 * static_cast<int>(n % cutout.size.width);
    const int y0 = box.y0 + 2 * static_cast<int>(n / cutout.size.width);
    float inside = 0;
    for (int i = 0; i < 4; ++i) {
      const int x = x0 + i % 2;
      const int y = y0 + i / 2;
      if (!mask.get(x, y)) continue;
      inside += 1;
      for (int c = 0; c < 3; ++c) cutout.colour[3 * n + c] += image.row(y)[3 * x + c];
    }
    for (int c = 0; c < 3; ++c) cutout.colour[3 * n + c] /= std::max(inside, 1.0F);
    cutout.cover[n] = inside / 4;
  }
  return cutout;
}

Cutout cut_out(const std::filesystem::path& studio, const std::string& camera) {
  const Image image = ctl::read_image(studio / "images" / (camera + ".png"));
  const Mask mask = without_rim(ctl::read_mask(studio / "masks" / (camera + ".png")));
  return halved(image, mask, mask.bounding_box());
}

struct Room {
  std::vector<Image> plates;
  std::vector<Image> backgrounds;  ///< frames of the second half of the recording
};

Room read_room(const std::filesystem::path& video) {
  ctl::VideoFile reader(video);
  std::vector<Image> frames;
  while (auto frame = reader.next()) frames.push_back(std::move(*frame));
  const auto half = static_cast<std::ptrdiff_t>(frames.size() / 2);
  Room room;
  room.plates.assign(frames.begin(), frames.begin() + std::min<std::ptrdiff_t>(half, kMaxPlates));
  room.backgrounds.assign(frames.begin() + half, frames.end());
  return room;
}

void blur_rows(std::vector<float>& values, ImageSize size, int radius) {
  std::vector<float> out(values.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int low = std::max(x - radius, 0);
      const int high = std::min(x + radius, size.width - 1);
      float sum = 0;
      for (int u = low; u <= high; ++u) sum += values[static_cast<size_t>(y) * size.width + u];
      out[static_cast<size_t>(y) * size.width + x] = sum / static_cast<float>(2 * radius + 1);
    }
  }
  values = std::move(out);
}

std::vector<float> transposed(const std::vector<float>& values, ImageSize size) {
  std::vector<float> out(values.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      out[static_cast<size_t>(x) * size.height + y] =
          values[static_cast<size_t>(y) * size.width + x];
    }
  }
  return out;
}

/// Shadow of the person, 0 to 1: a slanted, blurred copy of the outline.
std::vector<float> shadow_of(const Cutout& person, int x0, int y0, ImageSize size) {
  constexpr double kHeight = 0.4;  ///< height of the shadow, as a part of the person's height
  constexpr double kSlant = 0.8;
  std::vector<float> shadow(size.pixels());
  const int feet = y0 + person.size.height - 1;
  for (int y = 0; y <= std::min(feet, size.height - 1); ++y) {
    const double up = (feet - y) / kHeight;
    for (int x = 0; x < size.width; ++x) {
      shadow[static_cast<size_t>(y) * size.width + x] =
          person.cover_at(x - kSlant * (feet - y) - x0, person.size.height - 1 - up);
    }
  }
  for (const int radius : {4, 6, 8}) {
    blur_rows(shadow, size, radius);
    shadow = transposed(shadow, size);
    blur_rows(shadow, {size.height, size.width}, radius);
    shadow = transposed(shadow, {size.height, size.width});
  }
  return shadow;
}

/// Normally distributed random number, determined by a seed and an index.
double normal(uint64_t seed, uint64_t index) {
  const double radius = std::sqrt(-2 * std::log(1 - sim::uniform(seed, 2 * index, 0, 1)));
  return radius * std::cos(2 * std::numbers::pi * sim::uniform(seed, 2 * index + 1, 0, 1));
}

uint8_t seen(double light, double noise, uint64_t seed, uint64_t index) {
  const double value = light + noise * normal(seed, index);
  return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

Image with_noise(const Image& image, double noise, uint64_t seed) {
  Image noisy = image;
  for (size_t i = 0; i < noisy.bytes.size(); ++i) {
    noisy.bytes[i] = seen(image.bytes[i], noise, seed, i);
  }
  return noisy;
}

Composite paste(const Cutout& person, const Image& room, double standing,
                const Condition& condition, double gain, uint64_t seed) {
  const ImageSize size = room.size;
  const int x0 = static_cast<int>(standing * size.width) - person.size.width / 2;
  const int y0 = static_cast<int>(kFeet * size.height) - person.size.height;
  const std::vector<float> shadow = shadow_of(person, x0, y0, size);
  Composite composite{Image(size, PixelFormat::kRGB8), Mask(size)};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const size_t n = static_cast<size_t>(y) * size.width + x;
      const float cover = person.cover_at(x - x0, y - y0);
      const double light = 1 - condition.shadow * shadow[n];
      const float* colour =
          cover > 0 ? &person.colour[3 * (static_cast<size_t>(y - y0) * person.size.width + x - x0)]
                    : nullptr;
      for (int c = 0; c < 3; ++c) {
        const double behind = light * room.bytes[3 * n + c];
        const double mixed = colour ? cover * colour[c] + (1 - cover) * behind : behind;
        composite.colour.bytes[3 * n + c] = seen(gain * mixed, condition.noise, seed, 3 * n + c);
      }
      if (cover >= 0.5F) composite.truth.set(x, y);
    }
  }
  return composite;
}

}  // namespace

const std::vector<Condition>& conditions() {
  static const std::vector<Condition> kConditions = {{.name = "clean"},
                                                     {.name = "noise", .noise = 5},
                                                     {.name = "gain", .gain = 0.15},
                                                     {.name = "shadow", .shadow = 0.4},
                                                     {"all", 5, 0.15, 0.4}};
  return kConditions;
}

std::vector<TrialScene> make_scenes(const std::filesystem::path& data, const Condition& condition) {
  std::vector<Cutout> people;
  for (const char* camera : kPeople) people.push_back(cut_out(data / "studio20", camera));
  std::vector<TrialScene> scenes;
  uint64_t seed = kSeed;
  for (const char* camera : kRooms) {
    const Room room = read_room(data / "room4" / camera / "background.avi");
    TrialScene scene;
    for (const Image& plate : room.plates) {
      scene.plates.push_back(with_noise(plate, condition.noise, ++seed));
    }
    for (size_t n = 0; n < people.size(); ++n) {
      const double gain = n % 2 == 0 ? 1 + condition.gain : 1 - condition.gain;
      const Image& behind = room.backgrounds[n * room.backgrounds.size() / people.size()];
      const double standing = kStanding[(n + scenes.size()) % std::size(kStanding)];
      scene.composites.push_back(paste(people[n], behind, standing, condition, gain, ++seed));
    }
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

}  // namespace v3d::bench
