// v3d-segment-quality: how well silhouettes are found, ours against OpenCV's MOG2 and KNN at their
// best, on images whose truth is known.
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>

#include "base/error.h"
#include "segment_quality/report.h"
#include "v3dctl/media.h"

namespace {

using namespace v3d;
using namespace v3d::bench;

std::string default_data() {
  const char* variable = std::getenv("V3D_DATA");
  return variable ? variable : "../shared/data";
}

/// CONDITION-CAMERA-N.png, -truth.png and -ours.png, to look at.
void write_pictures(const std::filesystem::path& folder, const Condition& condition,
                    const std::vector<Scene>& scenes) {
  std::filesystem::create_directories(folder);
  for (size_t s = 0; s < scenes.size(); ++s) {
    for (size_t n = 0; n < scenes[s].composites.size(); ++n) {
      const Composite& composite = scenes[s].composites[n];
      const std::string stem =
          condition.name + "-" + std::to_string(s + 1) + "-" + std::to_string(n + 1);
      ctl::write_png(folder / (stem + ".png"), composite.colour.view());
      ctl::write_png(folder / (stem + "-truth.png"), image_from_mask(composite.truth).view());
      ctl::write_png(folder / (stem + "-ours.png"),
                     image_from_mask(our_mask(scenes[s], composite)).view());
    }
  }
}

void run(const std::string& data, const std::string& pictures, bool as_json) {
  std::vector<std::vector<Trial>> ours, mog2, knn;
  for (const Condition& condition : conditions()) {
    const std::vector<Scene> scenes = make_scenes(data, condition);
    if (!pictures.empty()) write_pictures(pictures, condition, scenes);
    ours.push_back({our_trial(scenes)});
    mog2.push_back(peer_trials("MOG2", scenes));
    knn.push_back(peer_trials("KNN", scenes));
    std::cerr << condition.name << " done\n";
  }
  const std::vector<Contestant> contestants = {best_of("ours", ours), best_of("MOG2", mog2),
                                               best_of("KNN", knn)};
  std::cout << (as_json ? json(contestants) : table(contestants));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Segmentation quality against OpenCV's MOG2 and KNN");
  std::string data = default_data();
  std::string pictures;
  bool as_json = false;
  app.add_option("--data", data, "Folder that holds room4/ and studio20/")->capture_default_str();
  app.add_option("--pictures", pictures, "Writes the composites, their truth and our masks there");
  app.add_flag("--json", as_json, "One JSON object on stdout");
  app.footer("Example:\n  v3d-segment-quality --pictures /tmp/composites");
  CLI11_PARSE(app, argc, argv);
  try {
    run(data, pictures, as_json);
  } catch (const InputError& e) {
    std::cerr << "v3d-segment-quality: " << e.what() << '\n';
    return 2;
  }
  return 0;
}
