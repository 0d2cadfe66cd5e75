// v3d-segment-quality: compares the segmentation quality of our segmenter with OpenCV's MOG2 and
// KNN at their best settings, on composite images with known silhouettes.
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>

#include "base/core/error.h"
#include "base/image/png_file.h"
#include "segment_quality/report.h"

namespace {

using namespace v3d;
using namespace v3d::bench;

struct Request {
  std::string data;
  std::string pictures;  ///< output folder; empty: none
  bool ours_alone = false;
  bool as_json = false;
};

std::string default_data() {
  const char* variable = std::getenv("V3D_DATA");
  return variable ? variable : "../shared/data";
}

/// Writes CONDITION-CAMERA-N.png, -truth.png and -ours.png for inspection.
void write_pictures(const std::filesystem::path& folder, const Condition& condition,
                    const std::vector<Scene>& scenes) {
  std::filesystem::create_directories(folder);
  for (size_t s = 0; s < scenes.size(); ++s) {
    for (size_t n = 0; n < scenes[s].composites.size(); ++n) {
      const Composite& composite = scenes[s].composites[n];
      const std::string stem =
          condition.name + "-" + std::to_string(s + 1) + "-" + std::to_string(n + 1);
      write_png(folder / (stem + ".png"), composite.colour.view());
      write_png(folder / (stem + "-truth.png"), image_from_mask(composite.truth).view());
      write_png(folder / (stem + "-ours.png"),
                image_from_mask(our_mask(scenes[s], composite)).view());
    }
  }
}

/// One segmenter, with its trials of every condition.
struct Entry {
  std::string name;
  std::vector<Trial> (*trials)(const std::vector<Scene>&);
  std::vector<std::vector<Trial>> of_condition;
};

template <SubtractorInput kInput>
std::vector<Trial> mog2(const std::vector<Scene>& scenes) {
  return peer_trials("MOG2", kInput, scenes);
}
template <SubtractorInput kInput>
std::vector<Trial> knn(const std::vector<Scene>& scenes) {
  return peer_trials("KNN", kInput, scenes);
}
std::vector<Trial> ours(const std::vector<Scene>& scenes) { return {our_trial(scenes)}; }

std::vector<Entry> entries(bool ours_alone) {
  if (ours_alone) return {{"ours", ours, {}}};
  return {{"ours", ours, {}},
          {"MOG2", mog2<SubtractorInput::kCamera>, {}},
          {"KNN", knn<SubtractorInput::kCamera>, {}},
          {"MOG2, full colour", mog2<SubtractorInput::kColour>, {}},
          {"KNN, full colour", knn<SubtractorInput::kColour>, {}}};
}

void run(const Request& request) {
  std::vector<Entry> all = entries(request.ours_alone);
  for (const Condition& condition : conditions()) {
    const std::vector<Scene> scenes = make_scenes(request.data, condition);
    if (!request.pictures.empty()) write_pictures(request.pictures, condition, scenes);
    for (Entry& entry : all) entry.of_condition.push_back(entry.trials(scenes));
    std::cerr << condition.name << " done\n";
  }
  std::vector<Contestant> contestants;
  for (const Entry& entry : all) contestants.push_back(best_of(entry.name, entry.of_condition));
  std::cout << (request.as_json ? json(contestants) : table(contestants));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Segmentation quality against OpenCV's MOG2 and KNN");
  Request request;
  request.data = default_data();
  app.add_option("--data", request.data, "Folder with room4/ and studio20/")->capture_default_str();
  app.add_option("--pictures", request.pictures,
                 "Write composites, true masks and our masks to this folder");
  app.add_flag("--ours", request.ours_alone,
               "Our segmenter only; takes seconds instead of minutes");
  app.add_flag("--json", request.as_json, "Print one JSON object on stdout");
  app.footer("Example:\n  v3d-segment-quality --pictures /tmp/composites");
  CLI11_PARSE(app, argc, argv);
  try {
    run(request);
  } catch (const InputError& e) {
    std::cerr << "v3d-segment-quality: " << e.what() << '\n';
    return 2;
  }
  return 0;
}
