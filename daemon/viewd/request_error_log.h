// Log of the errors of requests, which pages repeat.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "daemon/bus/event_sender.h"

namespace v3d::viewd {

/// Limits the lines about one file: EventThrottle permits the first one, then one for a doubled
/// number of errors or after a minute. Any thread.
class RequestErrorLog {
 public:
  /// More files in a minute share the limit of one.
  static constexpr size_t kMaxFiles = 100;

  /// The line to log for an error, with the number of errors that got none before; empty: none.
  /// `text` begins with the path of the file and ": ".
  std::optional<std::string> line(const std::string& text, MonotonicInstant now);

 private:
  struct File {
    int64_t errors = 0;
    int64_t logged = 0;  ///< number of errors until the last line
    MonotonicInstant last_error;
    bus::EventThrottle lines;
  };
  File& file_of(const std::string& text, MonotonicInstant now);

  std::mutex mutex_;
  std::map<std::string, File> files_;  ///< by path; "": those of shared limit
};

/// Logs the error of a request as a warning, within the limits of a RequestErrorLog of the process.
/// Any thread.
void log_request_error(const std::string& text);
/// The same for an error of the program, which is logged as an error.
void log_internal_error(const std::string& text);

}  // namespace v3d::viewd
