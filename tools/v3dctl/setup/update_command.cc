// update: installs a bundle on the appliances of the studio.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/options.h"
#include "v3dctl/setup/update.h"

namespace v3d::ctl {

namespace fs = std::filesystem;

UpdateFolder::UpdateFolder(std::string rsh, fs::path folder, int silence_s)
    : rsync_(std::move(rsh)),
      folder_(std::move(folder)),
      silence_("--timeout=" + std::to_string(silence_s)) {
  std::string name = fs::temp_directory_path() / "v3dctl-update-XXXXXX";
  if (mkdtemp(name.data()) == nullptr) throw InputError(errno_message(name));
  scratch_ = name;
}

UpdateFolder::~UpdateFolder() {
  std::error_code error;
  fs::remove_all(scratch_, error);
}

void UpdateFolder::send_bundle(const std::string& node, const fs::path& bundle) const {
  // --inplace: an interrupted copy continues in its file. It may have the size and the time of the
  // bundle, but other bytes. Without `silence_`, because the PC is silent while it writes the
  // bundle to its disk.
  std::vector<std::string> options = {"--inplace", "--no-whole-file"};
  if (on_terminal()) options.emplace_back("--info=progress2");
  send(node, bundle, "bundle.raucb", std::move(options));
}

void UpdateFolder::send_request(const std::string& node, const std::string& request) const {
  const fs::path file = scratch_ / "request";
  replace_file(file, request + "\n");
  send(node, file, "request", {silence_});
}

std::string UpdateFolder::report(const std::string& node) const {
  const fs::path file = scratch_ / "result.json";
  const ProcessResult fetched = rsync_.run(
      {silence_, "--ignore-times", "--max-size=" + std::to_string(kMaxInstallReportBytes)},
      {place(node, "result.json"), file}, Output::kCaptureBoth);
  if (fetched.status != 0) return "";
  return io::read_file(file, kMaxInstallReportBytes).value_or("");
}

std::string UpdateFolder::place(const std::string& node, const std::string& file) const {
  return node_folder(node, folder_ / file).place;
}

void UpdateFolder::send(const std::string& node, const fs::path& file, const std::string& name,
                        std::vector<std::string> options) const {
  options.insert(options.end(), {"--ignore-times", "--fsync"});
  const ProcessResult sent =
      rsync_.run(options, {fs::absolute(file), place(node, name)}, Output::kShow);
  if (sent.status == 0) return;
  stop_if_interrupted();  // a terminal sends the signal to rsync, too
  throw std::runtime_error("rsync to " + place(node, name) + " ended with status " +
                           std::to_string(sent.status) + "; try: ssh " + node);
}

namespace {

using Json = nlohmann::ordered_json;

constexpr Duration kReportPeriod = std::chrono::seconds(2);

/// Health by the studio's bus, files by rsync over the remote shell, as `takes collect` has them.
class StudioLink final : public UpdateLink {
 public:
  StudioLink(const Studio& studio, std::string rsh) : monitor_(studio), folder_(std::move(rsh)) {}

  std::map<std::string, wire::HealthMessage> health() override { return monitor_.state().health; }

  void send_bundle(const std::string& node, const fs::path& bundle) override {
    note(node + ": copying " + bundle.filename().string());
    folder_.send_bundle(node, bundle);
  }

  void send_request(const std::string& node, const std::string& request) override {
    folder_.send_request(node, request);
  }

  std::string install_report(const std::string& node) override {
    if (Monotonic::now() < next_report_) return "";
    next_report_ = Monotonic::now() + kReportPeriod;
    return folder_.report(node);
  }

  MonotonicInstant wait() override {
    monitor_.poll();
    return Monotonic::now();
  }

 private:
  StudioMonitor monitor_;
  const UpdateFolder folder_;
  MonotonicInstant next_report_;
};

struct UpdateArguments {
  fs::path bundle;
  std::vector<std::string> nodes;
  bool all = false;
  std::string rsh;
  double timeout_s = 2400;
  bool json = false;
};

std::vector<std::string> requested_nodes(const Studio& studio, const UpdateArguments& arguments) {
  if (arguments.all == !arguments.nodes.empty()) {
    throw InputError("update: name the nodes with --node, or give --all");
  }
  const std::vector<std::string> known = control::commanded_nodes(studio);
  if (arguments.all) return known;
  for (const std::string& node : arguments.nodes) {
    if (std::find(known.begin(), known.end(), node) == known.end()) {
      throw InputError("update --node " + node + ": no such node in " + studio.path.string());
    }
  }
  return arguments.nodes;
}

std::string text_of(const UpdatedNode& node) {
  std::string text = node.node + ": " + std::string(name(node.state));
  if (node.state == UpdatedNode::State::kUpdated) text += " to " + node.version;
  return node.message.empty() ? text : text + ": " + node.message;
}

Json nodes_json(const std::vector<UpdatedNode>& nodes) {
  Json list = Json::array();
  for (const UpdatedNode& node : nodes) {
    list.push_back({{"node", node.node},
                    {"state", name(node.state)},
                    {"version", node.version},
                    {"message", node.message}});
  }
  return {{"nodes", list}};
}

/// Exit status: done where every node is updated that can be.
int status_of(std::vector<UpdatedNode> nodes, bool skips_other_systems) {
  if (skips_other_systems) {
    std::erase_if(nodes, [](const UpdatedNode& node) {
      return node.state == UpdatedNode::State::kOtherSystem;
    });
  }
  const auto updated = static_cast<size_t>(
      std::ranges::count(nodes, UpdatedNode::State::kUpdated, &UpdatedNode::state));
  if (updated == 0) return kExitFailed;
  return updated == nodes.size() ? kExitDone : kExitIncomplete;
}

int run_update(const CommandLine& line, const UpdateArguments& arguments) {
  const Studio studio = line.studio();
  UpdateRequest request{.bundle = arguments.bundle,
                        .nodes = requested_nodes(studio, arguments),
                        .timeout = from_seconds(arguments.timeout_s),
                        .host = host_name(),
                        .skips_other_systems = arguments.all};
  if (access(request.bundle.c_str(), R_OK) != 0) {
    throw InputError(errno_message(request.bundle) + "; tools/build-image makes bundles");
  }
  StudioLink link(studio, arguments.rsh);
  catch_interrupts();
  // Every node has sent health by then; the first message of a node is not accepted.
  const MonotonicInstant all_sent = Monotonic::now() + std::chrono::seconds(3);
  while (link.wait() < all_sent) stop_if_interrupted();
  const std::vector<UpdatedNode> nodes = update_nodes(request, link);
  if (arguments.json) {
    std::printf("%s\n", nodes_json(nodes).dump(2).c_str());
  } else {
    for (const UpdatedNode& node : nodes) std::printf("%s\n", text_of(node).c_str());
  }
  return status_of(nodes, request.skips_other_systems);
}

}  // namespace

void add_update(CommandLine& line) {
  cli::Command command = line.add("update", "Install a new system on appliances, node by node",
                                  {"v3dctl update v3d-appliance-1.4.0.raucb --node cap07",
                                   "v3dctl update v3d-appliance-1.4.0.raucb --all"});
  auto arguments = std::make_shared<UpdateArguments>();
  command.add_option("BUNDLE", arguments->bundle, "The bundle of tools/build-image").required();
  command.add_option("--node", arguments->nodes, "A node to update (may be repeated)")
      .type_name("NODE")
      .take_one_word();
  command.add_flag("--all", arguments->all,
                   "Update all appliances, in the order of the studio file");
  command.add_option("--rsh", arguments->rsh, "Remote shell of rsync (otherwise ssh)")
      .type_name("COMMAND");
  command
      .add_option("--timeout", arguments->timeout_s,
                  "Give up after this many seconds for a node, after the copy")
      .type_name("S")
      .show_default()
      .check(cli::number_in(1, 86400));
  add_json_flag(command, arguments->json);
  line.on_run(command, [&line, arguments] { return run_update(line, *arguments); });
}

}  // namespace v3d::ctl
