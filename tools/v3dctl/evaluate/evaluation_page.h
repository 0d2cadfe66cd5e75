// Evaluation as an HTML page: measurements, errors as colours of the mesh, photographs and
// renderings.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/evaluate/evaluate_motion.h"

namespace v3d::ctl {

/// One set of meshes and its measurements.
struct EvaluationColumn {
  std::string name;
  EvaluatedMeshes evaluated;
  std::optional<TruthReport> truth;
  std::vector<HeldOutReport> held_out;
  std::optional<MotionReport> motion{};
};

struct EvaluationPage {
  std::vector<EvaluationColumn> columns;  ///< of the same take; at least one
  std::filesystem::path truth;            ///< empty: none
  std::vector<std::string> held_out;      ///< cameras
  bool view_dependent = false;            ///< as in HeldOutRequest
  recorded::ViewSource view_source = recorded::ViewSource::kPhotographs;
  int atlas_side = 0;  ///< as in HeldOutRequest
};

/// One HTML file that contains its images: of the middle one of the frames that all columns have,
/// or none.
std::string evaluation_html(const EvaluationPage& page);

/// Scale of error colours: evenly spaced from 0 to kMaxErrorMm; greater errors have the last
/// colour.
inline constexpr double kMaxErrorMm = 20;
inline constexpr Rgb8 kErrorColours[] = {
    {49, 100, 180}, {116, 183, 215}, {245, 240, 190}, {247, 158, 85}, {200, 30, 40}};

/// Renderings of the mesh from four sides, coloured by the distance of each vertex from the truth.
/// The cameras depend on the truth only, so that several meshes have equal views.
std::vector<Image> error_renderings(const Mesh& mesh, const Mesh& truth);

}  // namespace v3d::ctl
