// The files of a take: their names, lengths and checksums.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/io/result.h"
#include "take/take.h"
#include "wire/hash_tree.h"

namespace v3d {

/// What is known of one file.
struct TakeFile {
  std::string name;  ///< relative to the folder of the take: "background/cam01.mean.png"
  int64_t bytes = 0;
  int64_t changed_ns = 0;            ///< since 1970; 0 in a ledger
  std::optional<uint64_t> checksum;  ///< of base/core/checksum.h over all `bytes`; empty: not known
  std::optional<Hash> root = {};     ///< as take_signature.h says; empty: not known

  friend bool operator==(const TakeFile&, const TakeFile&) = default;
};

/// Checksum as text: 16 hexadecimal digits, as `xxhsum -H3` prints them.
std::string checksum_text(uint64_t checksum);
std::optional<uint64_t> parse_checksum(std::string_view text);

/// Where the bytes of a file are read from.
enum class ReadFrom : uint8_t {
  kPageCache,  ///< as every program reads
  kDisk,       ///< the kernel first writes what waits for the disk, and drops what it has cached
};

/// Names of all regular files of the take and of its background folder, sorted. Without hidden
/// names, which are working files of daemons and programs (locks, orders, pieces), and without what
/// a power cut left of io::replace_file().
[[nodiscard]] io::Result<std::vector<std::string>> take_file_names(const TakePaths& paths);

/// Whether it is the name of a signature: signature.<node>.toml (take_signature.h).
bool is_signature(std::string_view name);

/// A file that is written after the ledger, so that no ledger can have its checksum: the ledger
/// itself, verified.toml, the slate, mesh.v3d, signatures, and what recoveries find in segments
/// (SegmentIndex).
bool is_written_after_ledger(std::string_view name);

/// Length and time of change, without a checksum. Fails when the file cannot be asked.
[[nodiscard]] io::Result<TakeFile> stat_take_file(const TakePaths& paths, const std::string& name);

/// Reads a whole file. With `limit`, only the first so many bytes count into the checksum. Length
/// and time are those before the first byte was read. Fails with path and cause.
[[nodiscard]] io::Result<TakeFile> read_take_file(const TakePaths& paths, const std::string& name,
                                                  ReadFrom from, int64_t limit = INT64_MAX);

}  // namespace v3d
