// An evaluation as a page for people: figures, the error painted on the mesh, photographs beside
// renderings.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {

/// One set of meshes and what was measured of it.
struct EvaluatedColumn {
  std::string name;
  Evaluated evaluated;
  std::optional<TruthReport> truth;
  std::vector<HeldOutReport> held_out;
};

struct EvaluationPage {
  std::vector<EvaluatedColumn> columns;  ///< of the same take; at least one
  std::filesystem::path truth;           ///< empty without
  std::vector<std::string> held_out;     ///< the cameras
  bool view_dependent = false;
};

/// One HTML file with its pictures in it, all of the frame in the middle; needs nothing but a
/// browser.
std::string evaluation_html(const EvaluationPage& page);

}  // namespace v3d::ctl
