// v3d-segment-quality: compares the segmentation quality of our segmenter with OpenCV's MOG2 and
// KNN at their best settings, on composite images with known silhouettes.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "cli/command.h"
#include "segment_quality/segment_trials.h"

namespace v3d::bench {

// Report of v3d-segment-quality.

struct Contestant {
  std::string name;
  std::vector<Trial> of_condition;  ///< best trial of each condition, in the order of conditions()
  Trial overall;                    ///< best trial with one set of parameters for all conditions
};

/// Chooses the best trials by F. `trials[condition][setting]`.
Contestant best_of(const std::string& name, const std::vector<std::vector<Trial>>& trials);

/// A table in Markdown, followed by the parameters.
std::string table(const std::vector<Contestant>& contestants);
/// One JSON object: {"ours": {"clean": {"precision", "recall", "f", "parameters"}, ..., "overall"}}
std::string json(const std::vector<Contestant>& contestants);

namespace {

const Trial& best(const std::vector<Trial>& trials) {
  return *std::max_element(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) {
    return a.score.f() < b.score.f();
  });
}

/// Sums the scores of all conditions for each setting.
std::vector<Trial> pooled(const std::vector<std::vector<Trial>>& trials) {
  std::vector<Trial> sums = trials[0];
  for (size_t condition = 1; condition < trials.size(); ++condition) {
    for (size_t n = 0; n < sums.size(); ++n) sums[n].score += trials[condition][n].score;
  }
  return sums;
}

std::string cell(const Score& score) {
  return fmt::format(" {:.4f} ({:.3f}, {:.3f}) |", score.f(), score.precision(), score.recall());
}

nlohmann::ordered_json to_json(const Trial& trial) {
  return {{"precision", trial.score.precision()},
          {"recall", trial.score.recall()},
          {"f", trial.score.f()},
          {"parameters", trial.parameters}};
}

}  // namespace

Contestant best_of(const std::string& name, const std::vector<std::vector<Trial>>& trials) {
  Contestant contestant{name, {}, best(pooled(trials))};
  for (const std::vector<Trial>& of_condition : trials) {
    contestant.of_condition.push_back(best(of_condition));
  }
  return contestant;
}

std::string table(const std::vector<Contestant>& contestants) {
  std::string text = "| F (precision, recall) |";
  std::string rule = "| --- |";
  for (const Contestant& contestant : contestants) {
    text += " " + contestant.name + " |";
    rule += " --- |";
  }
  text += "\n" + rule + "\n";
  for (size_t n = 0; n < conditions().size(); ++n) {
    text += "| " + conditions()[n].name + " |";
    for (const Contestant& contestant : contestants) {
      text += cell(contestant.of_condition[n].score);
    }
    text += "\n";
  }
  text += "| overall, one setting |";
  for (const Contestant& contestant : contestants) text += cell(contestant.overall.score);
  text += "\n\n";
  for (const Contestant& contestant : contestants) {
    for (size_t n = 0; n < conditions().size(); ++n) {
      text += contestant.name + ", " + conditions()[n].name + ": " +
              contestant.of_condition[n].parameters + "\n";
    }
    text += contestant.name + ", overall: " + contestant.overall.parameters + "\n";
  }
  return text;
}

std::string json(const std::vector<Contestant>& contestants) {
  nlohmann::ordered_json all;
  for (const Contestant& contestant : contestants) {
    auto& its = all[contestant.name];
    for (size_t n = 0; n < conditions().size(); ++n) {
      its[conditions()[n].name] = to_json(contestant.of_condition[n]);
    }
    its["overall"] = to_json(contestant.overall);
  }
  return all.dump() + "\n";
}

}  // namespace v3d::bench

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
                    const std::vector<TrialScene>& scenes) {
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
  std::vector<Trial> (*trials)(const std::vector<TrialScene>&);
  std::vector<std::vector<Trial>> of_condition;
};

template <SubtractorInput kInput>
std::vector<Trial> mog2(const std::vector<TrialScene>& scenes) {
  return peer_trials("MOG2", kInput, scenes);
}
template <SubtractorInput kInput>
std::vector<Trial> knn(const std::vector<TrialScene>& scenes) {
  return peer_trials("KNN", kInput, scenes);
}
std::vector<Trial> ours(const std::vector<TrialScene>& scenes) { return {our_trial(scenes)}; }

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
    const std::vector<TrialScene> scenes = make_scenes(request.data, condition);
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
  cli::Program app("Segmentation quality against OpenCV's MOG2 and KNN");
  Request request;
  request.data = default_data();
  app.add_option("--data", request.data, "Folder with room4/ and studio20/").show_default();
  app.add_option("--pictures", request.pictures,
                 "Write composites, true masks and our masks to this folder");
  app.add_flag("--ours", request.ours_alone,
               "Our segmenter only; takes seconds instead of minutes");
  app.add_flag("--json", request.as_json, "Print one JSON object on stdout");
  app.footer("Example:\n  v3d-segment-quality --pictures /tmp/composites");
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  try {
    run(request);
  } catch (const InputError& e) {
    std::cerr << "v3d-segment-quality: " << e.what() << '\n';
    return 2;
  }
  return 0;
}
