// Searches all memory of this process for copies of secret keys.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/random.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "support/temporary_folder.h"
#include "wire/datagram_mac.h"
#include "wire/secret_keys.h"
#include "wire/signatures.h"

namespace v3d::wire {
namespace {

constexpr uint8_t kMask = 0x5a;

/// Makes a key file in a child process, so that this process has no copy of the key. A second file
/// holds the same text with every byte XORed with kMask; it is the pattern to search for.
template <class Key>
void make_key(const std::filesystem::path& path) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Key::make().save(path, "no such group");
    std::string text = read_file(path);
    text = text.substr(text.size() - 65, 64);
    for (char& c : text) c = static_cast<char>(c ^ kMask);
    std::ofstream(path.string() + ".masked") << text << std::flush;
    _exit(0);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
}

/// Bytes to search for, each XORed with kMask.
using Masked = std::vector<uint8_t>;

Masked masked_digits(const std::filesystem::path& key) {
  const std::string text = read_file(key.string() + ".masked");
  return {text.begin(), text.end()};
}

uint8_t value_of(uint8_t digit) {
  return digit <= '9' ? static_cast<uint8_t>(digit - '0') : static_cast<uint8_t>(digit - 'a' + 10);
}

Masked masked_bytes(const std::filesystem::path& key) {
  const Masked digits = masked_digits(key);
  Masked bytes;
  for (size_t i = 0; i < digits.size(); i += 2) {
    const auto high = value_of(digits[i] ^ kMask), low = value_of(digits[i + 1] ^ kMask);
    bytes.push_back(static_cast<uint8_t>((high << 4 | low) ^ kMask));
  }
  return bytes;
}

/// Searches all readable memory of this process block by block, except its own buffer.
class MemorySearch {
 public:
  ~MemorySearch() { close(memory_); }
  MemorySearch() = default;
  MemorySearch(const MemorySearch&) = delete;
  MemorySearch& operator=(const MemorySearch&) = delete;

  /// Number of copies of the first 16 of these bytes. Half a key must not leak either.
  size_t count(const Masked& wanted) {
    count_ = 0;
    std::ifstream maps("/proc/self/maps");
    std::vector<std::string> lines;
    for (std::string line; std::getline(maps, line);) lines.push_back(line);
    for (const std::string& line : lines) search_mapping(line, std::span(wanted).first(kPattern));
    return count_;
  }

 private:
  static constexpr size_t kPattern = 16;
  static constexpr uintptr_t kMaxMapping = 1U << 30;  // AddressSanitizer maps terabytes

  void search_mapping(const std::string& line, std::span<const uint8_t> wanted) {
    uintptr_t begin = 0, end = 0;
    std::array<char, 5> rights{};
    if (std::sscanf(line.c_str(), "%lx-%lx %4s", &begin, &end, rights.data()) != 3) return;
    if (rights[0] != 'r' || end - begin > kMaxMapping) return;
    const auto own = reinterpret_cast<uintptr_t>(part_.data());
    search_range(begin, std::clamp(own, begin, end), wanted);
    search_range(std::clamp(own + part_.size(), begin, end), end, wanted);
  }
  void search_range(uintptr_t begin, uintptr_t end, std::span<const uint8_t> wanted) {
    for (uintptr_t at = begin; at < end; at += part_.size() - (kPattern - 1)) {
      const size_t size = std::min<size_t>(part_.size(), end - at);
      const ssize_t got = pread(memory_, part_.data(), size, static_cast<off_t>(at));
      if (got > 0) search_part(std::span(part_).first(static_cast<size_t>(got)), wanted);
      std::ranges::fill(part_, uint8_t{0});
    }
  }
  /// Masks the bytes of the part and counts the wanted ones. memmem(), because a loop here takes a
  /// minute with a sanitizer.
  void search_part(std::span<uint8_t> part, std::span<const uint8_t> wanted) {
    for (uint8_t& byte : part) byte ^= kMask;
    const uint8_t* const end = part.data() + part.size();
    for (const uint8_t* at = part.data(); at < end; ++at, ++count_) {
      at = static_cast<const uint8_t*>(
          memmem(at, static_cast<size_t>(end - at), wanted.data(), wanted.size()));
      if (at == nullptr) return;
    }
  }

  const int memory_ = open("/proc/self/mem", O_RDONLY | O_CLOEXEC);
  std::vector<uint8_t> part_ = std::vector<uint8_t>(1 << 16);
  size_t count_ = 0;
};

class SecretMemory : public testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "a.key";
  MemorySearch memory_;
};

TEST_F(SecretMemory, search_finds_a_copy) {
  ASSERT_NO_FATAL_FAILURE(make_key<StudioKey>(path_));
  EXPECT_EQ(memory_.count(masked_digits(path_)), 0U);
  const std::string text = read_file(path_);
  EXPECT_GE(memory_.count(masked_digits(path_)), 1U);
}

TEST_F(SecretMemory, holds_a_studio_key_once_during_use_and_not_afterwards) {
  ASSERT_NO_FATAL_FAILURE(make_key<StudioKey>(path_));
  auto key = std::make_unique<StudioKey>(StudioKey::load(path_));
  auto copy = std::make_unique<StudioKey>(*key);
  auto mac = std::make_unique<DatagramMac>(*key);
  EXPECT_TRUE(copy->has_valid_mac(encode_with_mac(CommandMessage{}, *key)));
  MacTrailer trailer;
  mac->sign(masked_digits(path_), masked_digits(path_), trailer);
  EXPECT_TRUE(mac->verify(masked_digits(path_), masked_digits(path_), trailer));
  key->save(folder_ / "again.key", "no such group");
  EXPECT_EQ(memory_.count(masked_bytes(path_)), 1U);
  EXPECT_EQ(memory_.count(masked_digits(path_)), 0U);
  key.reset();
  copy.reset();
  mac.reset();
  EXPECT_EQ(memory_.count(masked_bytes(path_)), 0U);
}

TEST_F(SecretMemory, holds_a_signing_key_once_during_use_and_not_afterwards) {
  ASSERT_NO_FATAL_FAILURE(make_key<SigningKey>(path_));
  auto key = std::make_unique<SigningKey>(SigningKey::load(path_));
  const Signature signature = key->sign(masked_digits(path_));
  EXPECT_TRUE(key->public_key().has_signed(masked_digits(path_), signature));
  key->save(folder_ / "again.key", "no such group");
  EXPECT_EQ(memory_.count(masked_bytes(path_)), 1U);
  EXPECT_EQ(memory_.count(masked_digits(path_)), 0U);
  key.reset();
  EXPECT_EQ(memory_.count(masked_bytes(path_)), 0U);
}

/// The bytes of a new key, each XORed with kMask. Made in a child process, as make_key() does.
Masked make_masked_secret() {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return {};
  const pid_t child = fork();
  if (child == 0) {
    std::array<uint8_t, 32> bytes{};
    const ssize_t got = getrandom(bytes.data(), bytes.size(), 0);
    for (uint8_t& byte : bytes) byte ^= kMask;
    _exit(got == write(ends[1], bytes.data(), bytes.size()) ? 0 : 1);
  }
  Masked masked(32);
  close(ends[1]);
  const ssize_t got = read(ends[0], masked.data(), masked.size());
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return got == std::ssize(masked) ? masked : Masked();
}

TEST_F(SecretMemory, holds_a_frame_key_once_for_each_owner_and_not_after_use) {
  const Masked masked = make_masked_secret();
  ASSERT_EQ(masked.size(), 32U);
  SecretBuffer secret(masked.size());
  for (size_t i = 0; i < masked.size(); ++i) secret.bytes()[i] = masked[i] ^ kMask;
  auto key = std::make_unique<FrameKey>(std::move(secret));
  EXPECT_EQ(memory_.count(masked), 1U);
  const SigningKey recipient = SigningKey::make();
  const auto sealed = key->seal_for(recipient.public_key());
  ASSERT_TRUE(sealed);
  auto opened = FrameKey::open(*sealed, recipient);
  ASSERT_TRUE(opened);
  const DatagramMac mac = opened->mac();
  EXPECT_EQ(memory_.count(masked), 2U);
  key.reset();
  opened.reset();
  EXPECT_EQ(memory_.count(masked), 0U) << "the MAC has a derived key";
}

}  // namespace
}  // namespace v3d::wire
