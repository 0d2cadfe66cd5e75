// Files of secret keys: one line of 64 hexadecimal digits. Lines that start with '#' are comments.
#pragma once

#include <filesystem>
#include <string_view>

#include "wire/secret_buffer.h"

namespace v3d {

inline constexpr size_t kKeySize = 32;  ///< bytes

/// Texts for messages about one kind of key.
struct KeyKind {
  std::string_view name;     ///< "studio key"
  std::string_view made_by;  ///< "v3dctl key new"
  std::string_view remedy;   ///< how to get one, for the message about a missing file
  std::string_view remark;   ///< comment in the first line of a new file, with '#' and line end
};

/// Reads a key file. Leaves no copy of the key or of the text in memory.
///
/// Throws InputError with the remedy when the file does not exist, is longer than 4 KiB or holds no
/// key. It also throws when others than owner and group may read the file, or others than the owner
/// may write it.
SecretBuffer load_key_file(const std::filesystem::path& path, const KeyKind& kind);
/// The same for the text of a key file. `path` is used in messages.
SecretBuffer parse_key_file(std::string_view text, const std::filesystem::path& path,
                            const KeyKind& kind);

/// Writes a new key file that only its owner may read and write. If the process runs as root and
/// `group` exists, its members may read the file. On return, file and name are on the disk. Throws
/// InputError when the file exists already or cannot be written; then it is removed.
void save_key_file(const std::filesystem::path& path, const SecretBuffer& key, const KeyKind& kind,
                   const char* group);

}  // namespace v3d
