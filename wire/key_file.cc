#include "wire/key_file.h"

#include <fcntl.h>
#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "base/error.h"
#include "base/file.h"
#include "base/io/unique_fd.h"
#include "wire/hexadecimal.h"

namespace v3d {
namespace {

/// Only the owner may write a key file; only the owner and the group may read it.
void refuse_open_file(const std::filesystem::path& path, const KeyKind& kind) {
  const std::string name(kind.name);
  struct stat state {};
  if (stat(path.c_str(), &state) != 0) {
    const std::string remedy = errno == ENOENT ? "; " + std::string(kind.remedy) : "";
    throw InputError(errno_message("no " + name + ": " + path.string()) + remedy);
  }
  if ((state.st_mode & (S_IRWXO | S_IWGRP | S_IXGRP)) == 0) return;
  std::array<char, 8> mode{};
  std::snprintf(mode.data(), mode.size(), "%04o", state.st_mode & 07777U);
  throw InputError(path.string() + ": mode " + mode.data() + " lets others at the " + name +
                   "; try: chmod 640 " + path.string());
}

/// The one line that is no remark. Empty when there is no such line, or several.
std::string_view without_remarks(std::string_view text) {
  std::string_view found;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (line.empty() || line.front() == '#') continue;
    if (!found.empty()) return {};
    found = line;
  }
  return found;
}

/// In a namespace, root may own no such group: then the key stays its owner's alone.
void give_to_group(int fd, const char* group) {
  if (geteuid() != 0) return;
  const struct group* found = getgrnam(group);
  if (found != nullptr && fchown(fd, 0, found->gr_gid) == 0) fchmod(fd, 0640);
}

}  // namespace

KeyBytes load_key_file(const std::filesystem::path& path, const KeyKind& kind) {
  refuse_open_file(path, kind);
  return parse_key_file(read_file(path), path, kind);
}

KeyBytes parse_key_file(std::string_view text, const std::filesystem::path& path,
                        const KeyKind& kind) {
  KeyBytes key{};
  if (parse_hexadecimal(without_remarks(text), key)) return key;
  throw InputError(path.string() + ": expected a " + std::string(kind.name) +
                   " of 64 hexadecimal digits, as " + std::string(kind.made_by) + " makes");
}

void save_key_file(const std::filesystem::path& path, const KeyBytes& key, const KeyKind& kind,
                   const char* group) {
  const std::string name(kind.name);
  const std::string text = std::string(kind.remark) + hexadecimal(key) + "\n";
  const io::UniqueFd fd(open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!fd) throw InputError(errno_message("cannot make the " + name + " " + path.string()));
  give_to_group(fd.get(), group);
  const bool written =
      write(fd.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
      fsync(fd.get()) == 0;
  if (written) return;
  const std::string problem = errno_message("cannot write the " + name + " " + path.string());
  unlink(path.c_str());
  throw InputError(problem);
}

}  // namespace v3d
