#include "v3dctl/setup/update_folder.h"

#include <unistd.h>

#include <cstdlib>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
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

}  // namespace v3d::ctl
