#include <benchmark/benchmark.h>

#include "calib/rig/rig_fit.h"
#include "sim/cameras/board_walk.h"
#include "sim/rendering/scene.h"

namespace v3d::bench {
namespace {

/// Observations of a board moved through a simulated rig, with corner noise of 0.2 px.
std::vector<calib::CameraObservations> walk(const calib::Board& board, int cameras) {
  const Rig rig = sim::make_rig(cameras, {1024, 768}, 3);
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < board.corners(); ++i) corners.push_back(board.corner(i));
  std::vector<calib::CameraObservations> seen;
  for (const RigCamera& c : rig) seen.push_back({c.name, c.model.size(), {}});
  sim::BoardWalkOptions options;
  options.boards = 400;
  for (const sim::ObservedCorner& s : sim::walk_board(rig, corners, options).corners) {
    calib::BoardObservation& observation = seen[s.camera].observations[s.board];
    observation.corners.push_back(s.corner);
    observation.pixels.push_back(s.pixel);
  }
  return seen;
}

/// Fits the lenses and poses of a whole rig to observations.
void calibrate(benchmark::State& state) {
  const calib::Board board = calib::parse_board("chess:9x6:100mm");
  const auto seen = walk(board, static_cast<int>(state.range(0)));
  double rms = 0;
  for (auto _ : state) rms = fit_rig(board, seen, {}).rms_px;
  state.counters["rms_px"] = rms;
}
BENCHMARK(calibrate)
    ->Name("calibrate")
    ->ArgName("cameras")
    ->Arg(15)
    ->Arg(60)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->UseRealTime();

}  // namespace
}  // namespace v3d::bench
