// Benchmark of OpenCV's MOG2 and KNN on the frames of segment/15xXGA, with models learnt from the
// same plates.
//
// The input is the raw bytes as a grey image, one value a pixel, which is fastest.
// peer/opencv_*_colour uses colour images, demosaiced beforehand and not timed. Default settings:
// shadow detection is on, as in our segmenter; there is no clean-up of the result, which our time
// includes. All cores are used, one camera a core: a little faster than one image at a time on all
// cores.
#include <tbb/parallel_for.h>

#include "base/image/colour.h"
#include "peers/opencv_subtractor.h"
#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

using Method = SubtractorOptions::Method;

SubtractorOptions defaults(Method method) {
  return {.method = method, .threshold = method == Method::kMog2 ? 16.0 : 400.0, .shadows = true};
}

void segment(benchmark::State& state, Method method, Image (*prepare)(ImageView)) {
  std::vector<OpencvSubtractor> subtractors;
  std::vector<Image> frames;
  for (int c = 0; c < kCameras; ++c) {
    std::vector<Image> prepared;
    for (const Image& plate : plates(c)) prepared.push_back(prepare(plate.view()));
    std::vector<ImageView> views;
    for (const Image& plate : prepared) views.push_back(plate.view());
    subtractors.emplace_back(defaults(method)).learn(views);
    frames.push_back(prepare(raw_frames()[c].view()));
  }
  const double bytes = static_cast<double>(kSize.pixels()) * kCameras;
  measure(state, kCameras, bytes, [&] {
    tbb::parallel_for(0, kCameras, [&](int c) {
      benchmark::DoNotOptimize(subtractors[c].segment(frames[c].view()));
    });
  });
}

Image as_it_is(ImageView image) { return crop(image, {0, 0, image.size.width, image.size.height}); }

BENCHMARK_CAPTURE(segment, mog2, Method::kMog2, as_it_is)->Name("peer/opencv_mog2/15xXGA");
BENCHMARK_CAPTURE(segment, knn, Method::kKnn, as_it_is)->Name("peer/opencv_knn/15xXGA");
BENCHMARK_CAPTURE(segment, mog2, Method::kMog2, to_rgb)->Name("peer/opencv_mog2_colour/15xXGA");
BENCHMARK_CAPTURE(segment, knn, Method::kKnn, to_rgb)->Name("peer/opencv_knn_colour/15xXGA");

}  // namespace
}  // namespace v3d::bench
