// Appends the changes of this process below the prefix of the fault plan to the trace file
// (fault_trace.h). The functions do nothing when the plan has no trace. Thread-safe.
#pragma once

#include <sys/types.h>

#include <string>

#include "fault_trace.h"

namespace v3d::test {

/// Lock between all processes of the trace, held while one of them makes a change and records it.
/// It gives the records the order of the changes.
class TraceLock {
 public:
  TraceLock();
  ~TraceLock();
  TraceLock(const TraceLock&) = delete;
  TraceLock& operator=(const TraceLock&) = delete;
};

/// True when `path` exists. The injector does not intercept this check.
bool exists(const std::string& path);

/// Records bytes written at `offset`; a negative `offset` means just before the file position.
void record_write(int fd, const std::string& path, std::string bytes, off_t offset);
void record_sync(int fd);
void record_sync_of_all();
void record_length(int fd, off_t length);
void record_names(Change change, const std::string& path, const std::string& other = {});

}  // namespace v3d::test
