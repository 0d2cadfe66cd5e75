#include "wire/studio_key.h"

#include <fcntl.h>
#include <grp.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <string>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"

namespace v3d {
namespace {

static_assert(crypto_auth_BYTES == kSealSize);
static_assert(crypto_auth_KEYBYTES == 32);

constexpr size_t kDigits = 2 * crypto_auth_KEYBYTES;
constexpr char kRemark[] =
    "# The key of a V3D studio: who has it may command the studio. The same on every PC.\n";

/// Chooses libsodium's fastest code; cheap when it is done already.
void begin_sodium() {
  if (sodium_init() < 0) throw InputError("libsodium cannot begin");
}

/// Nobody but the owner may change a key, nobody but the owner and the group may know it.
void refuse_open_file(const std::filesystem::path& path) {
  struct stat state {};
  if (stat(path.c_str(), &state) != 0) {
    const std::string remedy = errno == ENOENT ? "; make it once with v3dctl key new, and copy it "
                                                 "to every PC of the studio"
                                               : "";
    throw InputError(errno_message("no studio key: " + path.string()) + remedy);
  }
  if ((state.st_mode & (S_IRWXO | S_IWGRP | S_IXGRP)) == 0) return;
  std::array<char, 8> mode{};
  std::snprintf(mode.data(), mode.size(), "%04o", state.st_mode & 07777U);
  throw InputError(path.string() + ": mode " + mode.data() +
                   " lets others at the studio key; try: chmod 640 " + path.string());
}

/// The only line that is no remark; empty when there is none, or are more.
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

StudioKey StudioKey::make() {
  begin_sodium();
  StudioKey key;
  crypto_auth_keygen(key.secret_.data());
  return key;
}

StudioKey StudioKey::load(const std::filesystem::path& path) {
  refuse_open_file(path);
  return parse(read_file(path), path);
}

StudioKey StudioKey::parse(std::string_view text, const std::filesystem::path& path) {
  begin_sodium();
  const std::string_view digits = without_remarks(text);
  StudioKey key;
  size_t size = 0;
  const bool parsed = digits.size() == kDigits &&
                      sodium_hex2bin(key.secret_.data(), key.secret_.size(), digits.data(), kDigits,
                                     nullptr, &size, nullptr) == 0;
  if (!parsed || size != key.secret_.size()) {
    throw InputError(path.string() +
                     ": expected a studio key of 64 hexadecimal digits, as v3dctl key new makes");
  }
  return key;
}

void StudioKey::save(const std::filesystem::path& path, const char* group) const {
  std::array<char, kDigits + 1> digits{};
  sodium_bin2hex(digits.data(), digits.size(), secret_.data(), secret_.size());
  const std::string text = kRemark + std::string(digits.data()) + "\n";
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) throw InputError(errno_message("cannot make the studio key " + path.string()));
  give_to_group(fd, group);
  const bool written =
      write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(fd) == 0;
  close(fd);
  if (written) return;
  const std::string problem = errno_message("cannot write the studio key " + path.string());
  unlink(path.c_str());
  throw InputError(problem);
}

void StudioKey::seal(Bytes& message) const {
  V3D_CHECK(message.size() > kSealSize);
  const size_t size = message.size() - kSealSize;
  crypto_auth(message.data() + size, message.data(), size, secret_.data());
}

bool StudioKey::has_sealed(std::span<const uint8_t> message) const {
  if (message.size() <= kSealSize) return false;
  const size_t size = message.size() - kSealSize;
  return crypto_auth_verify(message.data() + size, message.data(), size, secret_.data()) == 0;
}

StudioKey::Derived StudioKey::derive(std::string_view purpose) const {
  Derived derived{};
  crypto_generichash(derived.data(), derived.size(),
                     reinterpret_cast<const unsigned char*>(purpose.data()), purpose.size(),
                     secret_.data(), secret_.size());
  return derived;
}

int64_t random_nonce() {
  uint64_t bits = 0;
  randombytes_buf(&bits, sizeof bits);
  return static_cast<int64_t>(std::max<uint64_t>(bits >> 1, 1));
}

}  // namespace v3d
