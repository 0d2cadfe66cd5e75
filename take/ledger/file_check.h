// Steps of a verification: comparison of the files with the ledger, and indexes of log segments.
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/logs/event_log.h"
#include "take/take.h"
#include "wire/codec.h"
#include "wire/messages.h"

namespace v3d::take {

/// Reads the files of a take and compares them with the file list of its ledger. Reads each file
/// once, also after an error. One thread.
class FileCheck {
 public:
  /// `stored`: the ledger; null when it cannot be read. `result` gets the files, disagreements and
  /// notes. All must outlive the object.
  FileCheck(const TakePaths& paths, const Ledger* stored, ReadFrom from, Verification& result)
      : paths_(paths), stored_(stored), from_(from), result_(result) {}

  /// Reads all segments of a log. Later readers find them in the page cache.
  void read_log(const std::filesystem::path& log);
  /// Reads all other files. Reports files that are missing, files that the ledger does not list,
  /// and foreign_entries().
  void finish();

 private:
  bool has_list() const { return stored_ && !stored_->files.empty(); }
  void read(const std::string& name);
  void compare(const TakeFile& entry, const TakeFile& file);
  void report_unreadable(const std::string& line);
  void report_missing(const TakeFile& file);
  void report_unnamed(const std::string& name);
  void note_foreign_entries();
  void disagree(const std::string& name, const std::string& what);

  const TakePaths& paths_;
  const Ledger* const stored_;
  const ReadFrom from_;
  std::set<std::string> read_;  ///< names of the files that read() was called for
  Verification& result_;
};

// Indexes of log segments (SegmentIndex), which a recovery makes, and messages of events.

/// The head of a frame. Empty when the event does not start as a frame of its length; then the
/// length is not trusted and no further bytes are read.
io::Result<std::optional<wire::FrameHead>> read_head(const EventLogReader& log,
                                                     const EventSpan& event);

/// The message of an event; empty when it is damaged.
template <class Message>
io::Result<std::optional<Message>> read_message(const EventLogReader& log, const EventSpan& event) {
  const auto bytes = log.read(event);
  if (!bytes) return tl::make_unexpected(bytes.error());
  return wire::decode<Message>(*bytes);
}

/// Problems that a recovery finds before it counts pulses and frames.
struct IndexProblems {
  std::vector<std::string> read_errors;  ///< of segments
  std::vector<std::string> notes;        ///< of indexes that are replaced
};

/// Writes the index of every segment that has none, or none that can be used. A segment with a read
/// error gets no index, and the next recovery retries.
template <class Message>  // wire::PulseMessage, wire::FrameMessage
io::Status index_segments(const std::filesystem::path& path, IndexProblems& problems,
                          const ReadProgress& progress = {});

}  // namespace v3d::take
