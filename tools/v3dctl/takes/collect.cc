#include "v3dctl/takes/collect.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/child_process.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "common/console.h"
#include "take/joined_slate.h"
#include "take/ledger/take_account.h"
#include "take/take_transfer.h"
#include "v3dctl/takes/node_takes.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

class Collector {
 public:
  explicit Collector(CollectRequest request)
      : request_(with_absolute_folder(std::move(request))),
        staging_(request_.to),
        rsync_(request_.rsh) {}

  std::vector<CollectedTake> run() {
    io::throw_if_failed(io::create_folders(request_.to));
    read_sources();
    require_takes();
    std::vector<CollectedTake> collected;
    for (const auto& [take, sources] : takes_) collected.push_back(collect(take, sources));
    staging_.remove_if_empty();
    return collected;
  }

 private:
  using Sources = std::vector<const NodeFolder*>;

  /// rsync takes a relative path with a colon for a host.
  static CollectRequest with_absolute_folder(CollectRequest request) {
    request.to = fs::absolute(request.to);
    return request;
  }

  fs::path stage(const std::string& take) const { return staging_.of(take); }
  take::TakePaths place_of(const std::string& take) const { return {request_.to / take}; }
  /// The leading dots exclude a collision with the folder of a node.
  static fs::path joined(const fs::path& staged) { return staged / ".joined"; }
  static fs::path incoming(const fs::path& staged) { return staged / ".incoming"; }

  bool is_requested(const std::string& take) const {
    const auto& names = request_.takes;
    return names.empty() || std::find(names.begin(), names.end(), take) != names.end();
  }

  /// Lists the takes of all nodes, and compares those that the folder has with their copies.
  void read_sources() {
    const RunFolder own(request_.to);
    for (const NodeFolder& source : request_.sources) {
      const NodeTakes found = list_node_takes(rsync_, source, own.name());
      if (found.has_probe) {
        throw InputError("--to " + request_.to.string() + ": is the folder of takes of " +
                         source.node +
                         " itself; name another folder, or the other nodes with --from");
      }
      for (const std::string& take : found.takes) {
        if (!is_requested(take)) continue;
        takes_[take].push_back(&source);
        if (has_copy(take)) existing_.insert(take);
        if (!found.with_logs.contains(take) || found.recorded.contains(take)) continue;
        differences_[take] = source.node + ": " + take + " " + take::missing_info_text(take);
      }
      if (request_.takes.empty()) note_uncollected(source, found);
      compare_copies(source, found.recorded, own.path() / source.node);
    }
  }

  static void note_uncollected(const NodeFolder& source, const NodeTakes& found) {
    for (const std::string& name : found.odd_names) {
      note("note: " + source.node + ": '" + printable(name) +
           "' is no name of a take, and is not collected");
    }
    for (const std::string& name : found.broken_links) {
      note("note: " + source.node + ": '" + name +
           "' is a symbolic link to no folder, and is not collected; is its disk mounted?");
    }
  }

  /// Compares the takes of a node with those of their names in the folder of the copies. `into`: a
  /// new folder for take.toml, ledger.toml and slate.toml of the takes.
  void compare_copies(const NodeFolder& source, const std::set<std::string>& recorded,
                      const fs::path& into) {
    std::set<std::string> both;
    for (const std::string& take : recorded) {
      if (existing_.contains(take)) both.insert(take);
    }
    if (both.empty()) return;
    io::throw_if_failed(io::create_folders(into));
    fetch_summaries(rsync_, source, both, into);
    for (const std::string& take : both) {
      std::string& difference = differences_[take];
      if (difference.empty()) difference = difference_of(take, source, {into / take});
      const std::string slate = slate_note({into / take}, source.node, place_of(take));
      if (!slate.empty()) slate_notes_[take].push_back(slate);
    }
  }

  /// False also where this cannot be determined, which collect() reports.
  bool has_copy(const std::string& take) const {
    const auto type = io::type_of(place_of(take).info());
    return type && *type != fs::file_type::not_found;
  }

  /// Why a copy is not that of the part of a node; empty: it is, or cannot be read, which
  /// earlier_verification() reports.
  std::string difference_of(const std::string& take, const NodeFolder& source,
                            const take::TakePaths& fetched) const {
    std::optional<TakeSummary> copy;
    try {
      copy = read_summary(place_of(take));
    } catch (const InputError&) {
      return "";
    }
    try {
      return difference_from_copy(read_summary(fetched), source.node, *copy, place_of(take).folder);
    } catch (const InputError&) {
      return "cannot read take.toml of " + source.node + ", to compare it with " +
             place_of(take).folder.string();
    }
  }

  void require_takes() const {
    for (const std::string& take : request_.takes) {
      if (!takes_.contains(take)) throw InputError("no node has a take " + take);
    }
  }

  CollectedTake collect(const std::string& take, const Sources& sources) {
    CollectedTake result{
        .name = take, .was_there = false, .problem = {}, .meshes_of = {}, .verification = {}};
    try {
      const take::TakeLock lock = staging_.lock(take);
      if (file_exists(place_of(take).info())) {
        judge_copy(sources, result);
      } else {
        copy_take(sources, result);
      }
    } catch (const std::exception& error) {
      result.problem = error.what();
    }
    return result;
  }

  void judge_copy(const Sources& sources, CollectedTake& result) {
    result.was_there = true;
    if (!existing_.contains(result.name)) {
      throw InputError("another process has just collected it; repeat the command to compare it");
    }
    result.problem = differences_[result.name];
    if (!result.problem.empty()) return;
    result.verification = earlier_verification(place_of(result.name));
    std::ranges::copy(slate_notes_[result.name], std::back_inserter(result.verification.notes));
    try {
      reject_parts_of_others(result.name, sources);
      for (const NodeFolder* source : sources) {
        const take::TakePaths part{stage(result.name) / source->node};
        // Only a part that the node has, too, may be removed.
        if (fs::exists(part.folder) && !fs::is_empty(part.folder)) {
          prepare(result.name, *source, part);
        }
      }
      remove_copies(stage(result.name));
    } catch (const std::exception& error) {
      result.verification.disagreements.emplace_back(error.what());
    }
  }

  void copy_take(const Sources& sources, CollectedTake& result) {
    if (const std::string& lost = differences_[result.name]; !lost.empty()) throw InputError(lost);
    reject_other_folder(place_of(result.name));
    reject_parts_of_others(result.name, sources);
    remove_copies(joined(stage(result.name)));
    std::vector<take::TakePaths> parts;
    int64_t bytes = 0;
    for (const NodeFolder* source : sources) {
      parts.push_back({stage(result.name) / source->node});
      bytes += prepare(result.name, *source, parts.back());
    }
    require_space(result.name, parts, bytes);
    for (size_t i = 0; i < parts.size(); ++i) fetch(result.name, *sources[i], parts[i]);
    require_capture_nodes(parts);
    const take::MeshPart meshes = part_with_most_meshes(parts);
    if (mesh_files(parts) > 1) result.meshes_of = meshes.part->folder.filename();
    result.verification = join(result.name, sources, parts, place_of(result.name));
    // After the record of the verification, because the copy itself is right.
    std::ranges::copy(meshes.errors, std::back_inserter(result.verification.disagreements));
  }

  /// The record of a verification of the copy. A record that cannot be read says nothing.
  static std::optional<take::Verified> record_of(const take::TakePaths& place) {
    try {
      if (!file_exists(place.verified())) return std::nullopt;
      return take::parse_verified(read_take_text(place.verified()), place.verified());
    } catch (const InputError&) {
      return std::nullopt;
    }
  }

  /// What the ledger of an existing copy says. A copy that disagreed with it when it was verified,
  /// or was never verified, is verified again: its disk may have failed to read only once. A
  /// disagreement of another check, as of signatures, stays until that check is repeated.
  static take::Verification earlier_verification(const take::TakePaths& place) {
    take::Verification found;
    try {
      found.info = load_take_info(place);
      found.ledger = take::load_ledger(place.ledger());
      const std::optional<take::Verified> record = record_of(place);
      // Reconstruction adds files. They do not change what the record says of the recording.
      if (record && record->agrees) return found;
      if (record && !record->other_disagreement.empty()) {
        found.disagreements.push_back(record->other_disagreement + " (found by v3dctl verify " +
                                      place.folder.string() + "; repeat it)");
        return found;
      }
      found = verify_take(place, take::ReadFrom::kDisk);
      io::throw_if_failed(save_verified(place, found));
    } catch (const std::exception& error) {
      found.disagreements.emplace_back(error.what());
    }
    return found;
  }

  /// Throws InputError when a node that is collected from has no part of a take, although it has
  /// cameras or the trigger in the studio file of the take: its disk may not be mounted.
  void require_capture_nodes(const std::vector<take::TakePaths>& parts) const {
    for (const take::TakePaths& recorded : parts) {
      const std::optional<Studio> studio = load_take_studio(recorded);
      if (!studio || !file_exists(recorded.info())) continue;
      for (const NodeFolder& source : request_.sources) {
        const bool captures =
            !studio->cameras_of(source.node).empty() || studio->trigger.node == source.node;
        const bool has_part = std::ranges::any_of(parts, [&](const take::TakePaths& part) {
          return part.folder.filename() == source.node && file_exists(part.info());
        });
        if (!captures || has_part) continue;
        throw InputError(source.node + " has no part of it at " + source.place +
                         ": is its disk mounted? To collect without the node, name the others "
                         "with --from");
      }
    }
  }

  /// Throws InputError when the place of the copy has a folder that is no take.
  static void reject_other_folder(const take::TakePaths& place) {
    if (io::value_or_throw(io::entry_type_of(place.folder)) == fs::file_type::not_found) return;
    throw InputError(place.folder.string() +
                     ": exists, and has no take.toml; move it out of the folder");
  }

  /// Throws InputError when an earlier run has left a part of a node that is not collected from
  /// now: it may be the last copy of its frames. It is neither joined nor removed.
  void reject_parts_of_others(const std::string& take, const Sources& sources) const {
    if (!fs::exists(stage(take))) return;
    for (const fs::directory_entry& part : fs::directory_iterator(stage(take))) {
      const std::string node = part.path().filename();
      const bool is_source = std::ranges::any_of(
          sources, [&](const NodeFolder* source) { return source->node == node; });
      if (node.starts_with('.') || is_source || fs::is_empty(part)) continue;
      throw InputError(part.path().string() + ": is the part of " + node +
                       " that an earlier run has copied; collect from " + node +
                       ", too, or move this folder elsewhere, and repeat the command");
    }
  }

  static void reject_recording(const take::TakeInfo& info, const NodeFolder& source) {
    if (info.state != take::TakeState::kRecording) return;
    throw InputError(source.node + " records it, or stopped and has not restarted since");
  }

  /// Throws InputError when a process of the node has locked the take, whose lock files
  /// `described` has: a daemon that has restarted reads its logs for minutes, then continues it.
  static void reject_locked(const take::TakePaths& described, const NodeFolder& source) {
    for (const fs::path& file : io::value_or_throw(io::list_folder(described.folder))) {
      if (file.extension() != ".lock") continue;
      const std::string name = file.filename();
      const std::string text = io::value_or_throw(io::read_file(file, kMaxTakeTextBytes));
      throw InputError(printable(text.substr(0, text.find('\n'))) + " has locked it on " +
                       source.node + ", and may continue it; repeat the command later; if that " +
                       "process has ended, remove " + name + " there");
    }
  }

  /// Throws InputError when the part of a node cannot be collected now. Returns the bytes of its
  /// files on the node.
  int64_t prepare(const std::string& take, const NodeFolder& source,
                  const take::TakePaths& part) const {
    const take::TakePaths described{incoming(stage(take))};
    remove_copies(described.folder);
    for (const fs::path& folder : {part.folder, described.folder}) {
      io::throw_if_failed(io::create_folders(folder));
    }
    const std::string from = source.place + "/" + take;
    copy(source, {"--include=/take.toml", "--include=/.*.lock", "--exclude=*"}, from, described);
    if (file_exists(described.info())) {
      const take::TakeInfo info = load_take_info(described);
      reject_recording(info, source);
      if (info.state == take::TakeState::kRecovered) reject_locked(described, source);
      reject_other_take(info, part, source);
    }
    remove_copies(described.folder);
    return reject_other_files(source, from, part);
  }

  /// Throws InputError when the parts, of which earlier runs have copied some files, and a joined
  /// take without hard links do not fit on the disk: the copy would take hours until it is full.
  void require_space(const std::string& take, const std::vector<take::TakePaths>& parts,
                     int64_t bytes) const {
    if (has_hard_links(stage(take))) return;
    int64_t needed = 2 * bytes;
    for (const take::TakePaths& part : parts) needed -= bytes_in(part.folder);
    const uint64_t available = io::value_or_throw(io::free_bytes(stage(take)));
    // Some file systems do not know their free space.
    if (available == 0 || needed <= static_cast<int64_t>(available)) return;
    throw InputError(request_.to.string() +
                     ": its file system has no hard links, so the take needs its space twice until "
                     "it is joined, " +
                     format_bytes(static_cast<double>(needed)) + " more; " +
                     format_bytes(static_cast<double>(available)) +
                     " are free; collect it into a file system with hard links, such as ext4");
  }

  /// Copies the part of one node.
  void fetch(const std::string& take, const NodeFolder& source, const take::TakePaths& part) const {
    remove_shared_names(part.folder);
    if (on_terminal()) note(source.node + "  " + take);
    // --inplace: an interrupted copy continues in its file.
    std::vector<std::string> options = {"--inplace",
                                        "--no-whole-file",
                                        "--exclude=/verified.toml",
                                        "--exclude=/.shards-*",
                                        "--exclude=/.*.partial-*",
                                        "--exclude=/.*.lock"};
    if (on_terminal()) options.emplace_back("--info=progress2");
    copy(source, options, source.place + "/" + take, part);
    // The node may have continued the take while those of others were copied.
    if (file_exists(part.info())) reject_recording(load_take_info(part), source);
  }

  /// Throws InputError when an earlier run has left files in the staging folder that the node does
  /// not have. They may be of an earlier take of this name, or the node may have lost them: they
  /// are neither joined nor removed. Returns the bytes of the files on the node.
  int64_t reject_other_files(const NodeFolder& source, const std::string& from,
                             const take::TakePaths& part) const {
    const ProcessResult compared =
        rsync_.run({"--recursive", "--dry-run", "--delete", "--itemize-changes", "--stats",
                    "--size-only", "--exclude=/.*", "--exclude=/verified.toml"},
                   {from + "/", part.folder.string() + "/"}, Output::kCapture);
    require_success(compared, source);
    const std::vector<std::string> files = absent_files(compared.output);
    if (files.empty()) return total_bytes(compared.output);
    throw InputError(part.folder.string() + ": has files that " + source.node +
                     " does not have, of an earlier take of this name or lost on the node (" +
                     join_names(files) + "); move " + part.folder.parent_path().string() +
                     " out of the folder, and repeat the command");
  }

  static void require_success(const ProcessResult& copied, const NodeFolder& source) {
    if (copied.status == 0) return;
    throw std::runtime_error("rsync from " + source.node + " ended with status " +
                             std::to_string(copied.status) + "; repeat the command to continue");
  }

  /// Compares the content of every file, because size and time do not prove a file of an earlier
  /// run.
  void copy(const NodeFolder& source, std::vector<std::string> options, const std::string& from,
            const take::TakePaths& part) const {
    options.insert(options.end(), {"--recursive", "--ignore-times"});
    const ProcessResult copied =
        rsync_.run(options, {from + "/", part.folder.string() + "/"}, Output::kShow);
    require_success(copied, source);
  }

  static int64_t mesh_files(const std::vector<take::TakePaths>& parts) {
    return std::ranges::count_if(
        parts, [](const take::TakePaths& part) { return file_exists(part.mesh()); });
  }

  /// Whether every part equals the files of its node. rsync reads the copy from the page cache,
  /// which has the bytes that were just read back from the disk.
  bool equal_nodes(const std::string& take, const Sources& sources,
                   const std::vector<take::TakePaths>& parts) const {
    for (size_t i = 0; i < parts.size(); ++i) {
      if (!has_bytes_of(rsync_, *sources[i], take, parts[i].folder,
                        {"--exclude=/verified.toml", "--exclude=/.*"})) {
        return false;
      }
    }
    return true;
  }

  /// The same for the files without a checksum. Where these are sound, only sound is read again.
  bool equal_without_checksums(const take::TakePaths& whole, const std::string& take,
                               const Sources& sources,
                               const std::vector<take::TakePaths>& parts) const {
    const std::vector<std::string> files = files_without_checksum(whole);
    if (files.empty()) return true;
    const auto is_sound = [](const std::string& name) { return name.starts_with("sound/"); };
    if (!std::ranges::all_of(files, is_sound)) return equal_nodes(take, sources, parts);
    return std::ranges::all_of(sources, [&](const NodeFolder* source) {
      return has_bytes_of(rsync_, *source, take, whole.folder,
                          {"--existing", "--include=/sound/", "--include=/sound/*", "--exclude=*"});
    });
  }

  /// Verifies the copy by reading it back from its disk. Throws when it differs from the nodes'
  /// files. A file that is damaged on its node is a disagreement of the result.
  take::Verification read_back(const take::TakePaths& whole, const std::string& take,
                               const Sources& sources,
                               const std::vector<take::TakePaths>& parts) const {
    // rsync does not call fsync().
    io::throw_if_failed(io::sync_file_system(whole.folder));
    take::Verification verification = verify_take(whole, take::ReadFrom::kDisk);
    const bool is_copy = verification.disagreements.empty()
                             ? equal_without_checksums(whole, take, sources, parts)
                             : equal_nodes(take, sources, parts);
    if (is_copy) return verification;
    std::string lines;
    for (const std::string& line : verification.disagreements) lines += "\n  " + line;
    throw std::runtime_error(
        "the copy differs from the files of the nodes; repeat the command to copy it again" +
        lines);
  }

  take::Verification join(const std::string& take, const Sources& sources,
                          const std::vector<take::TakePaths>& parts, const take::TakePaths& place) {
    const fs::path staged = stage(take);
    const take::TakePaths whole{joined(staged)};
    join_parts(parts, whole);
    take::Verification verification = read_back(whole, take, sources, parts);
    io::throw_if_failed(save_verified(whole, verification));
    for (const std::string& file : files_not_joined(parts, whole)) {
      verification.notes.push_back(file + ": is not copied, because it is no file of a take");
    }
    std::ranges::copy(slates_not_joined(parts, whole), std::back_inserter(verification.notes));
    // Before the rename: after a power cut, a take with its final name is whole.
    io::throw_if_failed(io::sync_file_system(whole.folder));
    io::throw_if_failed(io::rename_new(whole.folder, place.folder));
    try {
      remove_copies(staged);
    } catch (const fs::filesystem_error& error) {  // the take is collected
      verification.notes.emplace_back(error.what());
    }
    return verification;
  }

  const CollectRequest request_;
  const StagingFolder staging_;
  const Rsync rsync_;
  std::map<std::string, Sources> takes_;
  std::set<std::string> existing_;  ///< takes that the folder of the copies had at the start
  /// By the name of a take: why the take in the folder of the copies is not that of the nodes, or a
  /// node does not know its own take. Empty: neither.
  std::map<std::string, std::string> differences_;
  /// By the name of a take: what was written on slates of nodes after it was collected.
  std::map<std::string, std::vector<std::string>> slate_notes_;
};

}  // namespace

std::vector<NodeFolder> sources_of(const Studio& studio) {
  std::vector<NodeFolder> sources;
  const fs::path folder = fs::absolute(studio.storage.takes).lexically_normal();
  for (const StudioNode& node : studio.nodes) {
    const bool has_takes = !studio.cameras_of(node.name).empty() ||
                           studio.trigger.node == node.name || studio.reconstructs(node.name);
    if (!has_takes) continue;
    sources.push_back(node_folder(node.name, folder));
  }
  return sources;
}

std::vector<CollectedTake> collect_takes(const CollectRequest& request) {
  return Collector(request).run();
}

}  // namespace v3d::ctl
