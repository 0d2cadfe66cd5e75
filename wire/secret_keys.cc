#include "wire/secret_keys.h"

#include <fmt/core.h>
#include <grp.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <span>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/io/disk_error.h"
#include "base/io/file.h"

namespace v3d::wire {
namespace {

uint8_t* allocate(size_t size) {
  // Also selects the fastest code of libsodium. A second call costs little.
  if (sodium_init() < 0) throw InputError("cannot initialise libsodium");
  auto* const bytes = static_cast<uint8_t*>(sodium_malloc(size));
  if (bytes == nullptr) throw InputError(errno_message("cannot allocate guarded memory for a key"));
  sodium_memzero(bytes, size);
  return bytes;
}

}  // namespace

SecretBuffer::SecretBuffer(size_t size) : bytes_(allocate(size)), size_(size) {}

SecretBuffer::SecretBuffer(SecretBuffer&& other) noexcept
    : bytes_(std::exchange(other.bytes_, nullptr)), size_(std::exchange(other.size_, 0)) {}

SecretBuffer::~SecretBuffer() { sodium_free(bytes_); }  // overwrites the bytes

bool operator==(const SecretBuffer& a, const SecretBuffer& b) {
  return a.size_ == b.size_ && sodium_memcmp(a.bytes_, b.bytes_, a.size_) == 0;
}

std::string hexadecimal(std::span<const uint8_t> bytes) {
  std::string text(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

void write_hexadecimal(std::span<const uint8_t> bytes, std::span<uint8_t> digits) {
  V3D_CHECK(digits.size() == 2 * bytes.size() + 1);
  sodium_bin2hex(reinterpret_cast<char*>(digits.data()), digits.size(), bytes.data(), bytes.size());
}

bool parse_hexadecimal(std::string_view text, std::span<uint8_t> bytes) {
  size_t size = 0;
  return text.size() == 2 * bytes.size() &&
         sodium_hex2bin(bytes.data(), bytes.size(), text.data(), text.size(), nullptr, &size,
                        nullptr) == 0 &&
         size == bytes.size();
}

namespace {

constexpr uint64_t kMaxFileBytes = 4096;

io::File open_key_file(const std::filesystem::path& path, const KeyKind& kind) {
  auto file = io::File::open(path, io::OpenMode::kRead);
  if (file) return *std::move(file);
  if (file.error().code != ENOENT) io::throw_input_error(file.error());
  errno = ENOENT;
  throw InputError(errno_message("no " + std::string(kind.name) + ": " + path.string()) + "; " +
                   std::string(kind.remedy));
}

/// Throws unless only the owner may write a key file, and only owner and group may read it.
void check_file_mode(const io::File& file, const KeyKind& kind) {
  struct stat state {};
  if (fstat(file.fd(), &state) != 0) throw InputError(errno_message(file.path().string()));
  if ((state.st_mode & (S_IRWXO | S_IWGRP | S_IXGRP)) == 0) return;
  const std::string mode = fmt::format("{:04o}", state.st_mode & 07777U);
  const std::string path = file.path().string();
  throw InputError(path + ": mode " + mode + " gives other users access to the " +
                   std::string(kind.name) + "; run: chmod 640 " + path);
}

[[noreturn]] void throw_invalid_key(const std::filesystem::path& path, const KeyKind& kind) {
  throw InputError(path.string() + ": expected a " + std::string(kind.name) +
                   " of 64 hexadecimal digits, as " + std::string(kind.made_by) + " makes");
}

/// Returns the only line that is no comment. Empty when there is none, or more than one.
std::string_view key_line(std::string_view text) {
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

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

/// "`what` `path`: <cause of `error`>".
io::IoError failure(const std::string& what, const std::filesystem::path& path,
                    const io::IoError& error) {
  errno = error.code;
  return {error.code, errno_message(what + " " + path.string())};
}

/// Makes the file readable for `group`. In a user namespace, root may not own the group; then only
/// the owner can read the file.
void set_group(int fd, const char* group) {
  if (geteuid() != 0) return;
  const struct group* found = getgrnam(group);
  if (found != nullptr && fchown(fd, 0, found->gr_gid) == 0) fchmod(fd, 0640);
}

}  // namespace

SecretBuffer load_key_file(const std::filesystem::path& path, const KeyKind& kind) {
  const io::File file = open_key_file(path, kind);
  check_file_mode(file, kind);
  const uint64_t size = io::value_or_throw(file.size());
  if (size > kMaxFileBytes) throw_invalid_key(path, kind);
  SecretBuffer text(size);
  const size_t read = io::value_or_throw(file.read(0, text.bytes()));
  return parse_key_file(text.text().substr(0, read), path, kind);
}

SecretBuffer parse_key_file(std::string_view text, const std::filesystem::path& path,
                            const KeyKind& kind) {
  SecretBuffer key(kKeySize);
  if (!parse_hexadecimal(key_line(text), key.bytes())) throw_invalid_key(path, kind);
  return key;
}

void save_key_file(const std::filesystem::path& path, const SecretBuffer& key, const KeyKind& kind,
                   const char* group) {
  const std::string name(kind.name);
  auto file = io::File::open(path, io::OpenMode::kCreatePrivate);
  if (!file) io::throw_creation_error(failure("cannot make the " + name, path, file.error()));
  set_group(file->fd(), group);
  SecretBuffer line(2 * key.size() + 1);
  write_hexadecimal(key.bytes(), line.bytes());
  line.bytes().back() = '\n';
  io::Status written = file->write(0, {bytes_of(kind.remark), line.bytes()});
  if (written) written = file->sync();
  if (written) written = io::sync_folder(std::filesystem::absolute(path).parent_path());
  if (written) return;
  unlink(path.c_str());
  throw std::runtime_error(failure("cannot write the " + name, path, written.error()).message);
}

namespace {

static_assert(crypto_auth_BYTES == kCommandMacSize);
static_assert(crypto_auth_KEYBYTES == kKeySize);

constexpr KeyKind kKind{
    .name = "studio key",
    .made_by = "v3dctl key new",
    .remedy = "make it once with v3dctl key new, and copy it to every PC of the studio",
    .remark =
        "# The key of a V3D studio. Its holders may command the studio. It is the same on every "
        "PC.\n"};

}  // namespace

StudioKey::StudioKey(SecretBuffer secret)
    : secret_(std::make_shared<const SecretBuffer>(std::move(secret))) {}

StudioKey StudioKey::make() {
  SecretBuffer secret(kKeySize);
  crypto_auth_keygen(secret.bytes().data());
  return StudioKey(std::move(secret));
}

StudioKey StudioKey::load(const std::filesystem::path& path) {
  return StudioKey(load_key_file(path, kKind));
}

StudioKey StudioKey::parse(std::string_view text, const std::filesystem::path& path) {
  return StudioKey(parse_key_file(text, path, kKind));
}

void StudioKey::save(const std::filesystem::path& path, const char* group) const {
  save_key_file(path, *secret_, kKind, group);
}

void StudioKey::add_mac(Bytes& message) const {
  V3D_CHECK(message.size() > kCommandMacSize);
  const size_t size = message.size() - kCommandMacSize;
  crypto_auth(message.data() + size, message.data(), size, secret_->data());
}

bool StudioKey::has_valid_mac(std::span<const uint8_t> message) const {
  if (message.size() <= kCommandMacSize) return false;
  const size_t size = message.size() - kCommandMacSize;
  return crypto_auth_verify(message.data() + size, message.data(), size, secret_->data()) == 0;
}

SecretBuffer StudioKey::derive(std::string_view purpose) const {
  SecretBuffer derived(kKeySize);
  crypto_generichash(derived.bytes().data(), derived.size(),
                     reinterpret_cast<const unsigned char*>(purpose.data()), purpose.size(),
                     secret_->data(), secret_->size());
  return derived;
}

int64_t random_nonce() {
  uint64_t bits = 0;
  randombytes_buf(&bits, sizeof bits);
  return static_cast<int64_t>(std::max<uint64_t>(bits >> 1, 1));
}

}  // namespace v3d::wire
