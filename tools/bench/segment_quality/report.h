// What v3d-segment-quality says.
#pragma once

#include <string>
#include <vector>

#include "segment_quality/trials.h"

namespace v3d::bench {

struct Contestant {
  std::string name;
  std::vector<Trial> of_condition;  ///< the best, in the order of conditions()
  Trial overall;  ///< one set of parameters for all conditions, the best over all of them
};

/// `trials[condition][setting]`: takes the best by F.
Contestant best_of(const std::string& name, const std::vector<std::vector<Trial>>& trials);

/// A table in Markdown, and the parameters below it.
std::string table(const std::vector<Contestant>& contestants);
/// One JSON object: {"ours": {"clean": {"precision", "recall", "f", "parameters"}, ..., "overall"}}
std::string json(const std::vector<Contestant>& contestants);

}  // namespace v3d::bench
