// Report of v3d-segment-quality.
#pragma once

#include <string>
#include <vector>

#include "segment_quality/trials.h"

namespace v3d::bench {

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

}  // namespace v3d::bench
