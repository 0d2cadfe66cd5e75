// v3d-captured: the cameras and the trigger of one node.
#include <spdlog/spdlog.h>

#include "daemon/capture_node.h"
#include "daemon/daemon_main.h"
#include "daemon/node_loop.h"
#include "daemon/service.h"
#include "daemon/take_folder.h"

namespace {

void run(const v3d::Studio& studio, const std::string& node) {
  std::vector<std::string> cameras;
  for (const v3d::StudioCamera& camera : studio.cameras_of(node)) cameras.push_back(camera.name);
  v3d::service::status("looking for takes that were left open");
  for (const std::string& line : v3d::recover_open_takes(studio, cameras)) spdlog::warn("{}", line);
  const std::string problem = v3d::receive_buffer_problem(studio.network.lcm_url);
  if (!problem.empty()) spdlog::warn("{}", problem);
  v3d::Bus bus(studio.network.lcm_url);
  v3d::CaptureNode work(studio, node, bus);
  v3d::NodeLoop(node, "v3d-captured", bus, work).run();
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::daemon_main(
      argc, argv, {"v3d-captured", "Runs the cameras and the trigger of one node of a studio."},
      run);
}
