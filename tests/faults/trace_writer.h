// Appends the changes that this process makes below the prefix of the fault plan to its trace
// (fault_trace.h). Without a trace in the plan, nothing is done. Thread-safe.
#pragma once

#include <sys/types.h>

#include <string>

#include "fault_trace.h"

namespace v3d::test {

/// Held by all processes of the trace while one of them makes a change and records it, so that the
/// order of the records is that of the changes.
class TraceLock {
 public:
  TraceLock();
  ~TraceLock();
  TraceLock(const TraceLock&) = delete;
  TraceLock& operator=(const TraceLock&) = delete;
};

/// Without a call that the injector sees.
bool exists(const std::string& path);

/// Records what was written at `offset`; when it is negative, at the file's own position.
void record_write(int fd, const std::string& path, std::string bytes, off_t offset);
void record_sync(int fd);
void record_sync_of_all();
void record_length(int fd, off_t length);
void record_names(Change change, const std::string& path, const std::string& other = {});

}  // namespace v3d::test
