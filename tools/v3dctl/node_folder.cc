#include "v3dctl/node_folder.h"

#include "common/console.h"

namespace v3d::ctl {

NodeFolder node_folder(const std::string& node, const std::filesystem::path& folder) {
  return {node, node == host_name() ? folder.string() : node + ":" + folder.string()};
}

ProcessResult Rsync::run(const std::vector<std::string>& options,
                         const std::vector<std::string>& paths, Output output) const {
  std::vector<std::string> words = {"rsync", "--times"};
  if (!rsh_.empty()) words.insert(words.end(), {"--rsh", rsh_});
  words.insert(words.end(), options.begin(), options.end());
  words.insert(words.end(), paths.begin(), paths.end());
  return run_process(words, output);
}

}  // namespace v3d::ctl
