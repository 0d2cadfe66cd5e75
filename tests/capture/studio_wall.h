// Synthetic images of a textured wall with noise, for the tests of the segmentation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "base/image/image.h"
#include "capture/segmentation/segmenter.h"

namespace v3d::capture {

using Colour = std::array<double, 3>;  ///< red, green, blue in grey values

/// A greenish wall that is brighter on the right, with a soft pattern.
inline Colour wall(int x, int y) {
  const double light = 0.8 + 0.002 * x + 0.05 * std::sin(0.2 * x) * std::sin(0.17 * y);
  return {70 * light, 120 * light, 90 * light};
}

/// Image of `scene` in `format`, with Gaussian noise of `sigma` grey values.
inline Image photograph(ImageSize size, PixelFormat format,
                        const std::function<Colour(int, int)>& scene, unsigned seed,
                        double sigma = 1.5) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma);
  Image image(size, format);
  const auto grey = [&](double value) {
    return static_cast<uint8_t>(std::clamp(std::lround(value + noise(random)), 0L, 255L));
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const Colour c = scene(x, y);
      if (format == PixelFormat::kRGB8) {
        for (int k = 0; k < 3; ++k) image.row(y)[3 * x + k] = grey(c[k]);
      } else if (is_bayer(format)) {
        image.row(y)[x] = grey(c[bayer_channel(format, x, y)]);
      } else {
        image.row(y)[x] = grey(0.3 * c[0] + 0.6 * c[1] + 0.1 * c[2]);
      }
    }
  }
  return image;
}

using Scene = std::function<Colour(int, int)>;

inline segmentation::BackgroundModel learn_scene(ImageSize size, PixelFormat format,
                                                 const Scene& scene, int plates = 10) {
  std::vector<Image> images;
  for (int i = 0; i < plates; ++i) images.push_back(photograph(size, format, scene, 1000 + i));
  std::vector<ImageView> views;
  for (const Image& image : images) views.push_back(image.view());
  return segmentation::learn_background(views);
}

inline segmentation::BackgroundModel learn_wall(ImageSize size, PixelFormat format) {
  return learn_scene(size, format, wall);
}

}  // namespace v3d::capture
