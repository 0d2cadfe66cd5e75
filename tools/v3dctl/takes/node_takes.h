// The takes of a node, reached by rsync, and the staging folder of their copies.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "take/ledger/ledger.h"
#include "take/take.h"
#include "take/take_lock.h"
#include "v3dctl/node_folder.h"

namespace v3d::ctl {

// The output of rsync.

/// A line of rsync --list-only: "drwxr-xr-x  4,096 2026/11/21 10:02:03 kendo-07/take.toml". rsync
/// writes the bytes of a name that are no text as "\#012".
struct ListedEntry {
  char type = ' ';  ///< 'd': folder, 'l': link to no folder, as of --copy-dirlinks
  std::filesystem::path path;
};

/// Empty for a line that is no entry.
std::optional<ListedEntry> parse_entry(const std::string& line);

/// The files of a take that only the receiver has, by the output of rsync --dry-run --delete
/// --itemize-changes: "*deleting   cam01.0001.lcmlog". Without folders, and without temporary
/// files, which vanish on a node.
std::vector<std::string> absent_files(const std::string& itemized);

/// The size of all files of the sender in the output of rsync --stats: "Total file size: 1,234
/// bytes"; 0 without this line.
int64_t total_bytes(const std::string& output);

// The takes of a node, with the content of their take.toml and ledger.toml.

/// Entries of the folder of takes of a node.
struct NodeTakes {
  std::set<std::string> takes;      ///< takes with a take.toml, a log or a mesh.v3d
  std::set<std::string> recorded;   ///< those with a take.toml
  std::set<std::string> with_logs;  ///< those with a log of a camera or of the pulses
  /// Folders with a take.toml, a log or a mesh.v3d whose names are no names of takes.
  std::set<std::string> odd_names;
  /// Symbolic links to no folder: the disk of their target may not be mounted.
  std::set<std::string> broken_links;
  /// The folder has the entry `probe`, so it is the folder in which the caller created it.
  bool has_probe = false;
};

/// Lists the folder of takes of a node. A symbolic link to the folder of a take is a take, because
/// operators move takes to other disks. `probe`: a path relative to the folder. Throws InputError
/// when the folder cannot be listed.
NodeTakes list_node_takes(const Rsync& rsync, const NodeFolder& source,
                          const std::filesystem::path& probe);

/// take.toml and ledger.toml of a take, or of the part of a node.
struct TakeSummary {
  take::TakeInfo info;
  std::optional<take::Ledger> ledger;  ///< empty: it cannot be read
};

/// Reads take.toml and ledger.toml. Throws InputError when take.toml cannot be read.
TakeSummary read_summary(const take::TakePaths& paths);

/// Copies take.toml, ledger.toml and slate.toml of these takes of a node to INTO/TAKE. A file that
/// rsync cannot read is missing there. Throws InputError when the node cannot be read at all.
void fetch_summaries(const Rsync& rsync, const NodeFolder& source,
                     const std::set<std::string>& takes, const std::filesystem::path& into);

/// Whether the files of a take on a node, of those that `options` of rsync select, have the same
/// bytes in the folder `copy`. Reads them on both sides. False also when rsync fails.
bool has_bytes_of(const Rsync& rsync, const NodeFolder& source, const std::string& take,
                  const std::filesystem::path& copy, std::vector<std::string> options);

/// Why `copy` in the folder `place` is no copy of `part`, which `node` has; empty: it is one.
///
/// The start in take.toml decides, which a collected take has from one of its parts. The other
/// parts have a start of their own, by the clock of their node, which may be wrong. For them, a log
/// of a camera with the same checksum decides; without one, a start that differs by less than a
/// minute. A copy is not whole when the ledger of the part has cameras, segments of their logs,
/// sound files, bytes, frames or pulses that its own lacks.
std::string difference_from_copy(const TakeSummary& part, const std::string& node,
                                 const TakeSummary& copy, const std::filesystem::path& place);

/// A line with what the crew wrote on the slate of `part`, on its node, and the slate of `copy`
/// lacks: "cap01/slate.toml: has ...". Empty when it lacks nothing.
std::string slate_note(const take::TakePaths& part, const std::string& node,
                       const take::TakePaths& copy);

// The staging folder of `takes collect`: the parts of takes until they are joined.

/// TO/.collect, in the folder of the copies. TO/.collect/TAKE has the parts of a take.
class StagingFolder {
 public:
  /// `to`: the folder of the copies.
  explicit StagingFolder(const std::filesystem::path& to) : folder_(to / kName) {}

  static constexpr const char* kName = ".collect";
  std::filesystem::path of(const std::string& take) const { return folder_ / take; }

  /// Excludes other processes from the parts and the copy of a take. Creates the folder. Throws
  /// InputError while another process holds the lock, with its host and number.
  take::TakeLock lock(const std::string& take) const;
  void remove_if_empty() const;

 private:
  std::filesystem::path folder_;
};

/// Throws InputError when an earlier run has copied another take of this name from the node into
/// `part`. `of_node`: take.toml of the node.
void reject_other_take(const take::TakeInfo& of_node, const take::TakePaths& part,
                       const NodeFolder& source);

/// Removes parts of takes in the staging folder. Throws std::filesystem::filesystem_error.
void remove_copies(const std::filesystem::path& folder);

/// Removes the names of those files of a part that have a second name. That is one in a collected
/// take, whose staging folder was not removed after the join. rsync writes into existing files, and
/// would change the collected take. Throws InputError or std::filesystem::filesystem_error.
void remove_shared_names(const std::filesystem::path& part);

/// Can the file system of a folder give one file two names? Throws std::runtime_error when no file
/// can be written there.
bool has_hard_links(const std::filesystem::path& folder);

/// Bytes of all files in a folder and its folders. Throws InputError or
/// std::filesystem::filesystem_error.
int64_t bytes_in(const std::filesystem::path& folder);

/// A hidden folder of this process in the staging folder, for files that it needs for a moment.
/// Removes the folder, and the staging folder if it is empty then.
class RunFolder {
 public:
  /// `to`: the folder of the copies. Throws std::runtime_error when the folder cannot be created.
  explicit RunFolder(const std::filesystem::path& to);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  /// Relative to the folder of the copies.
  const std::filesystem::path& name() const { return name_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path name_, path_;
};

}  // namespace v3d::ctl
