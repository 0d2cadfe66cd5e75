#include "segment_quality/report.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace v3d::bench {
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
  char text[80];
  std::snprintf(text, sizeof text, " %.4f (%.3f, %.3f) |", score.f(), score.precision(),
                score.recall());
  return text;
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
