#include "v3dctl/node_folder.h"

#include <cstdlib>

#include "common/console.h"

namespace v3d::ctl {

namespace {

/// A PC that loses its power closes no connection. ssh then ends 30 s (3 x 10 s) after its last
/// reply; without this, after two hours.
constexpr const char* kSsh = "ssh -o ConnectTimeout=20 -o ServerAliveInterval=10";

}  // namespace

NodeFolder node_folder(const std::string& node, const std::filesystem::path& folder) {
  return {node, node == host_name() ? folder.string() : node + ":" + folder.string()};
}

ProcessResult Rsync::run(const std::vector<std::string>& options,
                         const std::vector<std::string>& paths, Output output) const {
  std::vector<std::string> words = {"rsync", "--times"};
  if (!rsh_.empty()) {
    words.insert(words.end(), {"--rsh", rsh_});
  } else if (std::getenv("RSYNC_RSH") == nullptr) {
    words.insert(words.end(), {"--rsh", kSsh});
  }
  words.insert(words.end(), options.begin(), options.end());
  words.insert(words.end(), paths.begin(), paths.end());
  return run_process(words, output);
}

}  // namespace v3d::ctl
