// v3d-recond: reconstructs the frames of a studio while they are recorded.
#include <malloc.h>
#include <spdlog/spdlog.h>

#include "base/core/error.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/node_loop.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "daemon/recond/mesh_recovery.h"
#include "daemon/recond/recon_node.h"

namespace {

/// Throws when `node` is a capture node: two daemons would reply under one name.
void require_no_capture_node(const v3d::Studio& studio, const std::string& node) {
  if (studio.cameras_of(node).empty() && studio.trigger.node != node) return;
  throw v3d::InputError(
      studio.path.string() + ": reconstruction: '" + node +
      "' is a capture node; give the reconstruction a [[node]] of its own (it may "
      "be the same PC)");
}

void recover_take(const std::filesystem::path& mesh, const std::string& take,
                  v3d::node::NodeLoop& loop) {
  const v3d::recond::RecoveredMeshes recovered = v3d::recond::recover_mesh_file(mesh);
  if (!recovered.is_whole) spdlog::error("{}: {}", take, recovered.text);
  const auto meshes = static_cast<double>(recovered.meshes.value_or(0));
  loop.set_last_result(take, recovered.text,
                       recovered.meshes ? v3d::control::numbers_json({{"meshes", meshes}}) : "");
}

/// The node in the studio file; `given` is the option --node, or empty.
std::string node_of(const v3d::Studio& studio, const std::string& given) {
  const std::vector<std::string>& nodes = studio.reconstruction.nodes;
  if (given.empty() && nodes.size() == 1) return nodes.front();
  if (studio.reconstructs(given)) return given;
  std::string names;
  for (const std::string& node : nodes) names += (names.empty() ? "'" : ", '") + node + "'";
  throw v3d::InputError("--node: the reconstruction runs on " + names + " in " +
                        studio.path.string());
}

void run(const v3d::Studio& studio, const std::string& given) {
  const std::string node = node_of(studio, given);
  require_no_capture_node(studio, node);
  // Every node writes the meshes of the whole take, so two of them must not share a folder.
  std::optional<v3d::node::FolderLock> lock;
  if (studio.reconstruction.nodes.size() > 1) {
    lock.emplace(studio.storage.takes, ".v3d-recond", node);
  }
  const std::string problem = v3d::bus::receive_buffer_problem(studio.network.lcm_url);
  if (!problem.empty()) spdlog::warn("{}", problem);
  v3d::bus::Bus bus(studio.network.lcm_url, studio.network.frame_groups,
                    v3d::bus::ChannelList(studio));
  bus.join_frame_groups(v3d::bus::all_frame_groups(bus.frame_groups()));
  bus.authenticator().require_authentication();
  v3d::recond::ReconNode delegate(studio, node, bus);
  v3d::node::NodeLoop loop(
      {node, "v3d-recond", v3d::bus::credentials_of_node(studio, node), studio.network.metrics},
      bus, delegate);
  for (const auto& [take, command] : v3d::node::persisted_commands(studio, node).commands) {
    recover_take(v3d::node::take_paths(studio, take).mesh(), take, loop);
  }
  loop.run();
}

}  // namespace

int main(int argc, char** argv) {
  // Buffers are freed by other threads than those that allocate them. With one malloc arena per
  // thread the daemon is twice as large, and grows. With one arena it stays the same size, and no
  // lock contention was measurable.
  mallopt(M_ARENA_MAX, 1);
  return v3d::node::daemon_main(
      argc, argv,
      {.name = "v3d-recond",
       .purpose = "Reconstructs the frames of a studio while they are recorded.",
       .node_is_required = false},
      run);
}
