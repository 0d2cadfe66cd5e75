#include "base/image/colour_response.h"

#include <algorithm>
#include <cmath>

#include "base/core/check.h"

namespace v3d {

void correct(Image& image, const ColourResponse& response) {
  V3D_CHECK(image.format == PixelFormat::kRGB8);
  if (response.is_identity()) return;
  for (size_t i = 0; i + 2 < image.bytes.size(); i += 3) {
    uint8_t* const pixel = &image.bytes[i];
    const Eigen::Vector3d colour =
        response.corrected(Eigen::Vector3d(pixel[0], pixel[1], pixel[2]));
    for (int k = 0; k < 3; ++k) {
      pixel[k] = static_cast<uint8_t>(std::lround(std::clamp(colour[k], 0.0, 255.0)));
    }
  }
}

}  // namespace v3d
