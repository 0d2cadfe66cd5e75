#include "calib/rig/advice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/statistics.h"

namespace v3d::calib {
namespace {

constexpr int kGoodShared = 12;
constexpr double kGoodCoverage = 0.4;
constexpr double kMuchWorse = 2;

struct Neighbour {
  int camera = -1;
  int agreeing = 0;
  int together = 0;  ///< with all neighbours
};

Neighbour best_neighbour(const RigFit& fit, int camera) {
  Neighbour best;
  for (const PairPose& pair : fit.pairs) {
    if (pair.a != camera && pair.b != camera) continue;
    best.together += pair.agreeing;
    if (pair.agreeing <= best.agreeing) continue;
    best.agreeing = pair.agreeing;
    best.camera = pair.a == camera ? pair.b : pair.a;
  }
  return best;
}

/// The camera nearest to it, whether they share views or not: the one to show the board with.
int nearest_camera(const Rig& rig, int camera) {
  int nearest = -1;
  double least = 0;
  for (int other = 0; other < static_cast<int>(rig.size()); ++other) {
    if (other == camera) continue;
    const double d = (rig[other].model.center() - rig[camera].model.center()).norm();
    if (nearest < 0 || d < least) {
      least = d;
      nearest = other;
    }
  }
  return nearest;
}

void judge_shared(const RigFit& fit, std::vector<std::string>& weak) {
  for (int i = 0; i < static_cast<int>(fit.rig.size()); ++i) {
    const Neighbour best = best_neighbour(fit, i);
    if (best.agreeing >= kGoodShared) continue;
    const std::string& name = fit.rig[i].name;
    weak.push_back(name + " shares " + std::to_string(best.together) +
                   " views with its neighbours: show the board between " + name + " and " +
                   fit.rig[nearest_camera(fit.rig, i)].name);
  }
}

/// The ninth of the image that boards reached least, in words; empty where all were reached.
std::string empty_part(const CameraFit& camera, ImageSize size) {
  int counts[3][3] = {};
  for (const CornerResidual& r : camera.residuals) {
    const int x = std::clamp(static_cast<int>(3 * (r.pixel.x() + 0.5) / size.width), 0, 2);
    const int y = std::clamp(static_cast<int>(3 * (r.pixel.y() + 0.5) / size.height), 0, 2);
    ++counts[y][x];
  }
  constexpr const char* kRows[] = {"upper", "middle", "lower"};
  constexpr const char* kColumns[] = {"left", "middle", "right"};
  for (int y : {0, 2, 1}) {
    for (int x : {0, 2, 1}) {
      if (counts[y][x] == 0) return std::string(kRows[y]) + " " + kColumns[x];
    }
  }
  return {};
}

void judge_coverage(const RigFit& fit, std::vector<std::string>& weak) {
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const CameraFit& camera = fit.cameras[i];
    if (camera.coefficients == 0 || camera.coverage >= kGoodCoverage) continue;
    char text[80];
    std::snprintf(text, sizeof text, ": boards reached %.0f %% of its image",
                  100 * camera.coverage);
    const std::string part = empty_part(camera, fit.rig[i].model.size());
    weak.push_back(fit.rig[i].name + text +
                   (part.empty() ? ": show the board nearer to its edges"
                                 : ": show the board in the " + part + " part, and nearer"));
  }
}

void judge_errors(const RigFit& fit, std::vector<std::string>& weak) {
  std::vector<double> rms;
  for (const CameraFit& camera : fit.cameras) rms.push_back(camera.rms_px);
  const double usual = upper_median(rms);
  for (size_t i = 0; i < fit.rig.size(); ++i) {
    const CameraFit& camera = fit.cameras[i];
    if (camera.rms_px > kMuchWorse * usual) {
      char text[120];
      std::snprintf(text, sizeof text,
                    " misses by %.2f px, the median camera by %.2f: is it in "
                    "focus, fixed, and triggered?",
                    camera.rms_px, usual);
      weak.push_back(fit.rig[i].name + text);
    }
    if (4 * camera.rejected > camera.views) {
      weak.push_back(fit.rig[i].name + ": " + std::to_string(camera.rejected) +
                     " pictures were left out: move the board more slowly, or give it more light");
    }
    if (std::abs(camera.late) > 0.02) {
      char text[120];
      std::snprintf(text, sizeof text, " is %.2f pictures %s: look at its trigger",
                    std::abs(camera.late), camera.late > 0 ? "late" : "early");
      weak.push_back(fit.rig[i].name + text);
    }
  }
}

}  // namespace

std::vector<std::string> advice(const RigFit& fit) {
  std::vector<std::string> weak;
  judge_shared(fit, weak);
  judge_errors(fit, weak);
  judge_coverage(fit, weak);
  return weak;
}

}  // namespace v3d::calib
