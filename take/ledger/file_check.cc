#include "take/ledger/file_check.h"

#include <algorithm>
#include <cerrno>
#include <type_traits>

#include "base/core/text.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {

void FileCheck::read_log(const std::filesystem::path& log) {
  const auto segments = existing_segments(log);
  if (!segments) return result_.disagreements.push_back(segments.error().message);
  for (const auto& segment : *segments) read(segment.filename());
}

void FileCheck::finish() {
  const auto names = take_file_names(paths_);
  if (!names) return result_.disagreements.push_back(names.error().message);
  for (const std::string& name : *names) {
    if (name != paths_.verified().filename()) read(name);
  }
  note_foreign_entries();
  std::ranges::sort(result_.files, {}, &TakeFile::name);
  if (!has_list()) return;
  for (const TakeFile& file : stored_->files) {
    if (is_written_after_ledger(file.name)) continue;
    if (!std::ranges::binary_search(*names, file.name)) report_missing(file);
  }
}

void FileCheck::read(const std::string& name) {
  if (!read_.insert(name).second) return;
  // Earlier versions listed skeletons that a recovery found.
  const bool is_listed = has_list() && !is_written_after_ledger(name);
  const TakeFile* const entry = is_listed ? stored_->file(name) : nullptr;
  // Also the bytes behind the listed length: the checksum is compared with that of a whole copy.
  auto file = read_take_file(paths_, name, from_);
  if (!file) return report_unreadable(file.error().message);
  if (entry) compare(*entry, *file);
  if (is_listed && !entry) report_unnamed(name);
  result_.files.push_back(*std::move(file));
}

void FileCheck::compare(const TakeFile& entry, const TakeFile& file) {
  if (file.bytes != entry.bytes) {
    disagree(file.name, "has " + format_count(file.bytes) + " bytes, the ledger says " +
                            format_count(entry.bytes));
  } else if (entry.checksum && entry.checksum != file.checksum) {
    disagree(file.name, "has the checksum " + checksum_text(*file.checksum) + ", the ledger says " +
                            checksum_text(*entry.checksum));
  } else if (!entry.checksum) {
    const bool is_sound = file.name.starts_with(TakePaths().sound().string() + "/");
    result_.notes.push_back(file.name + ": the ledger has no checksum of it, as " +
                            (is_sound ? "of sound above 4 GiB" : "after a recovery"));
  }
}

/// Reports a log once, though it is read for its events, too.
void FileCheck::report_unreadable(const std::string& line) {
  if (std::ranges::find(result_.disagreements, line) != result_.disagreements.end()) return;
  result_.disagreements.push_back(line);
}

/// Reports a missing file, unless the frame count has already reported it.
void FileCheck::report_missing(const TakeFile& file) {
  const std::string path = (paths_.folder / file.name).string();
  const bool is_known = std::ranges::any_of(result_.disagreements, [&](const std::string& line) {
    return line.find(path) != std::string::npos || line.starts_with(file.name + ": missing");
  });
  if (!is_known) {
    disagree(file.name, "missing; the ledger lists it with " + format_count(file.bytes) + " bytes");
  }
}

void FileCheck::report_unnamed(const std::string& name) {
  const std::string what = "is not named in the ledger";
  if (is_part_of_take(name)) return disagree(name, what + "; move it out of the take");
  result_.notes.push_back(name + ": " + what);
}

void FileCheck::note_foreign_entries() {
  const auto foreign = foreign_entries(paths_);
  if (!foreign) return result_.disagreements.push_back(foreign.error().message);
  for (const std::string& name : *foreign) {
    const std::string what =
        name.ends_with("/") ? "is no folder of a take, and" : "its name is not UTF-8; it";
    result_.notes.push_back(printable(name) + ": " + what + " is not verified");
  }
}

void FileCheck::disagree(const std::string& name, const std::string& what) {
  result_.disagreements.push_back(name + ": " + what);
}

namespace {

/// True when an event is a whole message. Reads the data only if such a message can have this
/// length. Fails on read errors.
template <class Message>
io::Result<bool> is_whole(const EventLogReader& log, const EventSpan& event) {
  if constexpr (std::is_same_v<Message, wire::PulseMessage>) {
    if (event.data_size > kMaxPulseBytes) return false;
  } else {
    const auto head = read_head(log, event);
    if (!head) return tl::make_unexpected(head.error());
    if (!*head) return false;
  }
  const auto message = read_message<Message>(log, event);
  if (!message) return tl::make_unexpected(message.error());
  return message->has_value();
}

/// Builds the index of segment `number`. Fails on read errors.
///
/// After a power cut, the last events can have their length but not their bytes; such events are
/// not counted. Events are checked from the end, at most kMaxUnwrittenBytes back: earlier damage
/// has another cause and stays in the log.
template <class Message>
io::Result<SegmentIndex> index_of(const EventLogReader& log, uint32_t number) {
  constexpr uint64_t kMaxUnwrittenBytes = 64 << 20;
  const LogSegment& segment = log.segments()[number];
  SegmentIndex index{.bytes = segment.bytes,
                     .whole_bytes = 0,
                     .events = segment.events,
                     .damaged_places = segment.damaged_places};
  uint64_t end = 0;
  int64_t skipped = 0;
  for (auto event = log.events().rbegin(); event != log.events().rend(); ++event) {
    if (event->segment != number) continue;
    const uint64_t event_end = event->data_offset + event->data_size;
    if (end == 0) end = index.whole_bytes = event_end;
    if (end - event_end > kMaxUnwrittenBytes) return index;
    const auto whole = is_whole<Message>(log, *event);
    if (!whole) return tl::make_unexpected(whole.error());
    if (*whole) {
      index.whole_bytes = event_end;
      index.events -= skipped;
      return index;
    }
    ++skipped;
  }
  return index;
}

}  // namespace

io::Result<std::optional<wire::FrameHead>> read_head(const EventLogReader& log,
                                                     const EventSpan& event) {
  const auto begin = log.read(event, wire::kFrameHeadSize);
  if (!begin) return tl::make_unexpected(begin.error());
  auto head = wire::decode_frame_head(*begin);
  return head && head->message_size == event.data_size ? std::move(head) : std::nullopt;
}

template <class Message>
io::Status index_segments(const std::filesystem::path& path, IndexProblems& problems,
                          const ReadProgress& progress) {
  if (is_absent_log(path)) return {};  // the verification reports it
  const auto log = EventLogReader::open(path, progress);
  if (!log) return tl::make_unexpected(log.error());
  for (uint32_t number = 0; number < log->segments().size(); ++number) {
    const LogSegment& segment = log->segments()[number];
    // Sync the log before the ledger: after a power cut, the ledger must not list events that the
    // log has lost.
    if (auto synced = segment.file.sync(); !synced) return synced;
    if (segment.index) continue;
    if (!segment.index_error.empty()) {
      problems.notes.push_back(segment.index_error + "; the index was made again");
    }
    io::Result<SegmentIndex> index =
        tl::make_unexpected(io::IoError{.code = EIO, .message = segment.read_error});
    if (segment.read_error.empty()) index = index_of<Message>(*log, number);
    if (!index) {
      problems.read_errors.push_back(index.error().message);
    } else if (auto saved = save_segment_index(segment.file.path(), *index); !saved) {
      return saved;
    }
  }
  return {};
}

template io::Status index_segments<wire::PulseMessage>(const std::filesystem::path&, IndexProblems&,
                                                       const ReadProgress&);
template io::Status index_segments<wire::FrameMessage>(const std::filesystem::path&, IndexProblems&,
                                                       const ReadProgress&);

}  // namespace v3d::take
