// What a disk may hold after a power cut, by the trace of the changes before it.
//
// Model: everything that was synced is there. Of the rest any part may be: of a file, each 4 KiB
// page that was written since its last fsync() is new, old or zero, and its length old or new; of a
// folder, each name that was changed since its last fsync().
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "fault_trace.h"

namespace v3d::test {

enum class CrashMode {
  /// Names change on the disk in the order of the calls, and every fsync() writes all earlier ones:
  /// ext4 with data=ordered.
  kOrdered,
  /// Names change in any order, each by itself; an fsync() of a file does not write its name. Less
  /// than any journalling file system promises, and all that POSIX does.
  kHarsh,
};

/// The changes of a trace, as a file system that forgets what was not synced.
class CrashModel {
 public:
  /// `folder` as it is before the trace is recorded; all of it counts as synced.
  explicit CrashModel(const std::filesystem::path& folder);
  /// Changes below that folder. Throws std::runtime_error when they do not fit the model.
  void add(const std::vector<TracedChange>& trace);

  const std::vector<TracedChange>& trace() const { return trace_; }
  /// Of a write: the name that its file had first.
  std::string file_of(size_t write) const;
  /// The file of this write was synced after it, before the change `count`.
  bool is_synced(size_t write, size_t count) const;

  /// Writes to `place`, which must not exist, what the disk may hold when the power fails before
  /// the change `count`.
  void make_image(const std::filesystem::path& place, size_t count, CrashMode mode,
                  std::mt19937& random) const;
  /// The same without a power cut: all that was done.
  void make_whole(const std::filesystem::path& place) const;

 private:
  struct Write {
    size_t at = 0;  ///< in the trace
    uint64_t offset = 0;
    std::string bytes;
    bool is_length = false;  ///< `offset` is the new length
  };
  struct Node {
    bool is_folder = false;
    std::string name;
    std::map<std::string, size_t> initial_entries, entries;  ///< of a folder, before and behind
    std::string initial;                                     ///< content of a file before
    std::vector<Write> writes = {};
    std::vector<size_t> syncs = {};
  };
  /// Removes a name, puts one, or both.
  struct NameChange {
    size_t at = 0;
    struct Name {
      size_t folder = 0;
      std::string name;
    };
    std::optional<Name> gone, put;
    size_t node = 0;
  };
  using Entries = std::vector<std::map<std::string, size_t>>;  ///< by node

  size_t load(const std::filesystem::path& path);
  NameChange::Name resolve(const std::string& path) const;
  void add_change(size_t at, const TracedChange& change);
  void add_name_change(const NameChange& change);
  bool is_durable(const NameChange& change, size_t count) const;
  std::vector<bool> kept_names(size_t count, CrashMode mode, std::mt19937& random) const;
  Entries entries_with(const std::vector<bool>& kept) const;
  static std::string content(const Node& node, size_t end);
  std::string torn_content(const Node& node, size_t count, std::mt19937& random) const;

  const std::string root_;
  std::vector<TracedChange> trace_;
  std::vector<Node> nodes_;
  std::map<uint64_t, size_t> node_of_;  ///< by inode number, now
  std::map<size_t, size_t> written_;    ///< node of a write, by its place in the trace
  std::vector<NameChange> name_changes_;
  std::vector<size_t> any_syncs_;  ///< places of all syncs, rising
};

}  // namespace v3d::test
