#include "crash_image.h"

#include <sys/stat.h>

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "base/io/file.h"
#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;

constexpr size_t kPage = 4096;

uint64_t inode_of(const fs::path& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) throw std::runtime_error("no " + path.string());
  return status.st_ino;
}

/// Chooses which unsynced parts one image keeps: all, none, or each at random.
class LossChoice {
 public:
  explicit LossChoice(std::mt19937& random) : random_(random), kind_(random() % 4) {}
  bool keeps() { return kind_ == 0 || (kind_ > 1 && random_() % 2 == 0); }

 private:
  std::mt19937& random_;
  const unsigned kind_;
};

}  // namespace

CrashModel::CrashModel(const fs::path& folder) : root_(folder) { load(folder); }

size_t CrashModel::load(const fs::path& path) {
  const size_t index = nodes_.size();
  const bool is_folder = fs::is_directory(path);
  nodes_.push_back({.is_folder = is_folder,
                    .name = path.filename(),
                    .initial_entries = {},
                    .entries = {},
                    .initial = is_folder ? std::string() : read_file(path)});
  node_of_[inode_of(path)] = index;
  if (!is_folder) return index;
  std::map<std::string, size_t> entries;
  for (const auto& entry : fs::directory_iterator(path)) {
    entries[entry.path().filename()] = load(entry.path());
  }
  nodes_[index].initial_entries = nodes_[index].entries = entries;
  return index;
}

CrashModel::NameChange::Name CrashModel::resolve(const std::string& path) const {
  size_t folder = 0;
  const fs::path relative = fs::path(path).lexically_relative(root_);
  for (const fs::path& part : relative.parent_path()) {
    const auto found = nodes_[folder].entries.find(part);
    if (found == nodes_[folder].entries.end())
      throw std::runtime_error("trace: no folder of " + path);
    folder = found->second;
  }
  return {folder, relative.filename()};
}

void CrashModel::add(const std::vector<TracedChange>& trace) {
  for (const TracedChange& change : trace) {
    trace_.push_back(change);
    add_change(trace_.size() - 1, change);
  }
}

void CrashModel::add_change(size_t at, const TracedChange& change) {
  switch (change.change) {
    case Change::kCreate:
    case Change::kMakeDir: {
      const auto name = resolve(change.path);
      node_of_[change.file] = nodes_.size();
      nodes_.push_back({.is_folder = change.change == Change::kMakeDir,
                        .name = name.name,
                        .initial_entries = {},
                        .entries = {},
                        .initial = {}});
      add_name_change({at, {}, name, nodes_.size() - 1});
      break;
    }
    case Change::kRename: {
      const auto from = resolve(change.path);
      add_name_change({at, from, resolve(change.other), nodes_[from.folder].entries.at(from.name)});
      break;
    }
    case Change::kLink: {
      const auto from = resolve(change.path);
      add_name_change({at, {}, resolve(change.other), nodes_[from.folder].entries.at(from.name)});
      break;
    }
    case Change::kUnlink: {
      const auto gone = resolve(change.path);
      add_name_change({at, gone, {}, nodes_[gone.folder].entries.at(gone.name)});
      break;
    }
    case Change::kWrite:
    case Change::kTruncate: {
      const size_t node = node_of_.at(change.file);
      written_[at] = node;
      nodes_[node].writes.push_back(
          {at, change.offset, change.bytes, change.change == Change::kTruncate});
      break;
    }
    case Change::kSync:
      nodes_[node_of_.at(change.file)].syncs.push_back(at);
      any_syncs_.push_back(at);
      break;
    case Change::kSyncAll:
      for (Node& node : nodes_) node.syncs.push_back(at);
      any_syncs_.push_back(at);
      break;
    case Change::kMark:
      break;
  }
}

void CrashModel::add_name_change(const NameChange& change) {
  if (change.gone) nodes_[change.gone->folder].entries.erase(change.gone->name);
  if (change.put) nodes_[change.put->folder].entries[change.put->name] = change.node;
  name_changes_.push_back(change);
}

std::string CrashModel::file_of(size_t write) const { return nodes_[written_.at(write)].name; }

bool CrashModel::is_synced(size_t write, size_t count) const {
  return std::ranges::any_of(nodes_[written_.at(write)].syncs,
                             [&](size_t sync) { return write < sync && sync < count; });
}

bool CrashModel::is_durable(const NameChange& change, size_t count) const {
  const auto is_synced = [&](const std::optional<NameChange::Name>& name) {
    return !name || std::ranges::any_of(nodes_[name->folder].syncs, [&](size_t sync) {
      return change.at < sync && sync < count;
    });
  };
  return is_synced(change.gone) && is_synced(change.put);
}

std::vector<bool> CrashModel::kept_names(size_t count, CrashMode mode, std::mt19937& random) const {
  std::vector<bool> kept(name_changes_.size());
  const auto done = static_cast<size_t>(
      std::ranges::count_if(name_changes_, [&](const auto& c) { return c.at < count; }));
  if (mode == CrashMode::kHarsh) {
    LossChoice choice(random);
    for (size_t i = 0; i < done; ++i) {
      kept[i] = is_durable(name_changes_[i], count) || choice.keeps();
    }
    return kept;
  }
  const auto after = std::ranges::lower_bound(any_syncs_, count);
  const size_t last_sync = after == any_syncs_.begin() ? 0 : *std::prev(after);
  const auto durable = static_cast<size_t>(
      std::ranges::count_if(name_changes_, [&](const auto& c) { return c.at < last_sync; }));
  const size_t first_lost = durable + random() % (done - durable + 1);
  std::fill_n(kept.begin(), first_lost, true);
  return kept;
}

CrashModel::Entries CrashModel::entries_with(const std::vector<bool>& kept) const {
  Entries entries;
  for (const Node& node : nodes_) entries.push_back(node.initial_entries);
  for (size_t i = 0; i < kept.size(); ++i) {
    const NameChange& change = name_changes_[i];
    if (!kept[i]) continue;
    if (change.gone) {
      // When an earlier change is lost, the name may belong to another file.
      auto& folder = entries[change.gone->folder];
      const auto found = folder.find(change.gone->name);
      if (found != folder.end() && found->second == change.node) folder.erase(found);
    }
    if (change.put) entries[change.put->folder][change.put->name] = change.node;
  }
  return entries;
}

std::string CrashModel::content(const Node& node, size_t end) {
  std::string content = node.initial;
  for (const Write& write : node.writes) {
    if (write.at >= end) break;
    if (write.is_length) {
      content.resize(write.offset);
      continue;
    }
    content.resize(std::max<size_t>(content.size(), write.offset + write.bytes.size()));
    content.replace(write.offset, write.bytes.size(), write.bytes);
  }
  return content;
}

std::string CrashModel::torn_content(const Node& node, size_t count, std::mt19937& random) const {
  const auto after = std::ranges::lower_bound(node.syncs, count);
  const std::string old = content(node, after == node.syncs.begin() ? 0 : *std::prev(after));
  const std::string now = content(node, count);
  if (now == old) return now;
  std::string torn = now;
  if (random() % 3 == 0) torn.resize(old.size());
  LossChoice choice(random);
  for (size_t page = 0; page < torn.size(); page += kPage) {
    if (choice.keeps()) continue;
    for (size_t i = page; i < std::min(page + kPage, torn.size()); ++i) {
      torn[i] = i < old.size() ? old[i] : '\0';
    }
  }
  return torn;
}

void CrashModel::make_image(const fs::path& place, size_t count, CrashMode mode,
                            std::mt19937& random) const {
  const Entries entries = entries_with(kept_names(count, mode, random));
  const std::function<void(size_t, const fs::path&)> make = [&](size_t node, const fs::path& at) {
    if (!nodes_[node].is_folder) return write_text(at, torn_content(nodes_[node], count, random));
    fs::create_directory(at);
    for (const auto& [name, entry] : entries[node]) make(entry, at / name);
  };
  make(0, place);
}

void CrashModel::make_whole(const fs::path& place) const {
  const std::function<void(size_t, const fs::path&)> make = [&](size_t node, const fs::path& at) {
    if (!nodes_[node].is_folder) return write_text(at, content(nodes_[node], trace_.size()));
    fs::create_directory(at);
    for (const auto& [name, entry] : nodes_[node].entries) make(entry, at / name);
  };
  make(0, place);
}

}  // namespace v3d::test
