// v3d-recond: the live reconstruction of a studio.
#include <spdlog/spdlog.h>

#include "base/error.h"
#include "daemon/daemon_main.h"
#include "daemon/node_loop.h"
#include "daemon/recon_node.h"

namespace {

/// Both daemons of one node would answer under one name.
void refuse_capture_node(const v3d::Studio& studio, const std::string& node) {
  if (studio.cameras_of(node).empty() && studio.trigger.node != node) return;
  throw v3d::InputError(studio.path.string() + ": reconstruction.node: '" + node +
                        "' captures; give the reconstruction a [[node]] of its own (it may be the "
                        "same PC)");
}

void run(const v3d::Studio& studio, const std::string& given) {
  const v3d::RealtimeInstant began = v3d::Realtime::now();
  const std::string node = given.empty() ? studio.reconstruction.node : given;
  if (node != studio.reconstruction.node) {
    throw v3d::InputError("--node: the reconstruction runs on '" + studio.reconstruction.node +
                          "', says " + studio.path.string());
  }
  refuse_capture_node(studio, node);
  const std::string problem = v3d::receive_buffer_problem(studio.network.lcm_url);
  if (!problem.empty()) spdlog::warn("{}", problem);
  v3d::Bus bus(studio.network.lcm_url);
  v3d::ReconNode work(studio, node, bus);
  v3d::NodeLoop({node, "v3d-recond", studio.network.key, began, studio.network.metrics}, bus, work)
      .run();
}

}  // namespace

int main(int argc, char** argv) {
  return v3d::daemon_main(
      argc, argv,
      {.name = "v3d-recond",
       .purpose = "Reconstructs the frames of a studio while they are recorded.",
       .node_is_required = false},
      run);
}
