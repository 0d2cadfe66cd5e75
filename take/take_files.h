// Files of a take: their names, and text files with a checksum.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/toml_file.h"
#include "base/io/file.h"
#include "take/logs/log_files.h"
#include "take/take.h"
#include "wire/signatures.h"

namespace v3d::take {

// Names, lengths and checksums of the files of a take.

/// Name, length, modification time and checksums of one file.
struct TakeFile {
  std::string name;  ///< relative to the folder of the take: "background/cam01.mean.png"
  int64_t bytes = 0;
  int64_t changed_ns = 0;            ///< modification time, ns since 1970; 0 in a ledger
  std::optional<uint64_t> checksum;  ///< XXH3 (base/core/bytes.h) of all `bytes`; empty: unknown
  std::optional<wire::Hash> root =
      {};  ///< root of the hash tree (take_signature.h); empty: unknown

  friend bool operator==(const TakeFile&, const TakeFile&) = default;
};

/// The checksum as 16 hexadecimal digits, as `xxhsum -H3` prints it.
std::string checksum_text(uint64_t checksum);
std::optional<uint64_t> parse_checksum(std::string_view text);

/// The source of the bytes that read_take_file() returns.
enum class ReadFrom : uint8_t {
  kPageCache,  ///< the page cache if it has the bytes, as for every program
  kDisk,       ///< the disk: dirty pages are written and cached pages are dropped first
};

/// Sorted names of all regular files of the take folder and of its folders background and sound.
/// Omits hidden names, which are working files of daemons and programs (locks, commands, partial
/// files), temporary files that a power cut left behind in io::replace_file(), and names that are
/// not UTF-8, which a ledger cannot list: see foreign_entries(). Fails with path and cause when a
/// folder cannot be listed.
[[nodiscard]] io::Result<std::vector<std::string>> take_file_names(const TakePaths& paths);

/// Sorted names of the folders in a take that V3D neither makes nor reads, as "kendo-08/" and
/// "sound/mix/": for example a take that was moved into another one. Also files whose names are not
/// UTF-8, without a slash, as of another operating system. No program verifies or copies these
/// files, or those in the folders. Fails with path and cause when a folder cannot be listed.
[[nodiscard]] io::Result<std::vector<std::string>> foreign_entries(const TakePaths& paths);

/// True for the name of a signature file: signature.<node>.toml (take_signature.h).
bool is_signature(std::string_view name);

/// True for the name of a file that programs read as part of a take, and that its ledger must list:
/// logs, calibration, studio file, plates, sound.
bool is_part_of_take(std::string_view name);

/// True for the name of a skeleton (docs/skeleton.md): skeleton.json, skeleton.performer2.json.
bool is_skeleton(std::string_view name);

/// True for the name of TakePaths::earlier_motion(): motion.earlier-1.v3d.
bool is_earlier_motion(std::string_view name);

/// True for a file that is written after the ledger, whose checksum no ledger can contain: the
/// ledger itself, verified.toml, the slate, mesh.v3d, proxy.v3d, motion.v3d and earlier ones,
/// skeletons, repaired.<node>.txt, signatures, and segment indexes of recoveries (SegmentIndex).
bool is_written_after_ledger(std::string_view name);

/// Reads length and modification time of a file, without a checksum. Fails with path and cause when
/// stat() fails.
[[nodiscard]] io::Result<TakeFile> stat_take_file(const TakePaths& paths, const std::string& name);

/// Reads a whole file and computes its checksum. Length and modification time are those at the
/// start of the read. `progress`: called before each MiB is read. Fails with path and cause, also
/// when the name is a symbolic link, and for a file with large holes (SparseReader).
[[nodiscard]] io::Result<TakeFile> read_take_file(const TakePaths& paths, const std::string& name,
                                                  ReadFrom from, const ReadProgress& progress = {});

// Text files with a checksum of their own: ledger.toml, and the indexes of log segments.
//
// The first line is xxh3 = '<XXH3 of all following bytes>', a valid line of TOML.

/// `content` below the line with its checksum.
std::string with_checksum(std::string_view content);

/// Has the text a line with its checksum, and is that right?
bool has_right_checksum(std::string_view text);

/// Parses a file that with_checksum() made, or one of an earlier version without that line. Throws
/// InputError when the checksum is wrong, and as TomlTable::parse() does.
TomlTable parse_checksummed(std::string_view text, const std::filesystem::path& path);

}  // namespace v3d::take
