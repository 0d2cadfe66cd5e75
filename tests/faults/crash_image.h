// Model of the content of a disk after a power cut, made from the trace of the changes before it.
//
// The disk holds everything that was synced, and any part of the later changes. Each 4 KiB page of
// a file that was written since the file's last fsync() is new, old or zero; the length is old or
// new. Each name in a folder that was changed since the folder's last fsync() is new or old.
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
  /// Names change in any order, independently; an fsync() of a file does not write its name. POSIX
  /// guarantees no more than this; every journalling file system does.
  kHarsh,
};

/// Applies the changes of a trace as a file system that may lose changes that were not synced.
class CrashModel {
 public:
  /// `folder`: its state before the trace is recorded. All of it counts as synced.
  explicit CrashModel(const std::filesystem::path& folder);
  /// Adds changes below that folder. Throws std::runtime_error when they do not fit the model.
  void add(const std::vector<TracedChange>& trace);

  const std::vector<TracedChange>& trace() const { return trace_; }
  /// The first name of the file that the change `write` wrote to.
  std::string file_of(size_t write) const;
  /// True when the file of `write` was synced after it and before the change `count`.
  bool is_synced(size_t write, size_t count) const;

  /// Writes to `place`, which must not exist, one possible content of the disk when the power fails
  /// before the change `count`. `random` chooses which changes are lost.
  void make_image(const std::filesystem::path& place, size_t count, CrashMode mode,
                  std::mt19937& random) const;
  /// Writes the content without a power cut: all changes are done.
  void make_whole(const std::filesystem::path& place) const;

 private:
  struct Write {
    size_t at = 0;  ///< index in the trace
    uint64_t offset = 0;
    std::string bytes;
    bool is_length = false;  ///< `offset` is the new length
  };
  struct Node {
    bool is_folder = false;
    std::string name;
    std::map<std::string, size_t> initial_entries, entries;  ///< of a folder, before and after
    std::string initial;                                     ///< content of a file before the trace
    std::vector<Write> writes = {};
    std::vector<size_t> syncs = {};
  };
  /// Removes the name `gone`, adds the name `put`, or both.
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
  std::map<size_t, size_t> written_;    ///< node of a write, by its index in the trace
  std::vector<NameChange> name_changes_;
  std::vector<size_t> any_syncs_;  ///< indices of all syncs, ascending
};

}  // namespace v3d::test
