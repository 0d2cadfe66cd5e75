// Files of secret keys: 64 hexadecimal digits on a line of their own, lines that begin with '#' are
// remarks.
#pragma once

#include <filesystem>
#include <string_view>

#include "wire/secret_buffer.h"

namespace v3d {

inline constexpr size_t kKeySize = 32;  ///< bytes

/// What the messages about a kind of key say.
struct KeyKind {
  std::string_view name;     ///< "studio key"
  std::string_view made_by;  ///< "v3dctl key new"
  std::string_view remedy;   ///< where there is no such file: "make it once with ..."
  std::string_view remark;   ///< first line of a new file, with '#' and line end
};

/// Throws InputError, with the remedy: when there is no such file, when others than its owner and
/// its group may read it or others than its owner may write it, when it is longer than 4 KiB or
/// holds no key. No copy of the key or of the text stays in memory.
SecretBuffer load_key_file(const std::filesystem::path& path, const KeyKind& kind);
/// `path` names the text in messages.
SecretBuffer parse_key_file(std::string_view text, const std::filesystem::path& path,
                            const KeyKind& kind);

/// Writes a file that only its owner may read and write, and, when this is root and there is a
/// group of that name, the members of `group` may read. Throws InputError when the file exists
/// already or cannot be written.
void save_key_file(const std::filesystem::path& path, const SecretBuffer& key, const KeyKind& kind,
                   const char* group);

}  // namespace v3d
