// The test's side of the shared memory of the fault injector (fault_report.h).
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "fault_report.h"
#include "faulty_program.h"
#include "support/temporary_folder.h"

namespace v3d::test {

/// Creates the file and maps it. Throws std::runtime_error.
class MappedReport {
 public:
  explicit MappedReport(const std::filesystem::path& file) {
    write_text(file, std::string(sizeof(FaultReport), '\0'));
    const int fd = open(file.c_str(), O_RDWR | O_CLOEXEC);
    void* const memory =
        mmap(nullptr, sizeof(FaultReport), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (memory == MAP_FAILED) throw std::runtime_error("mmap " + file.string());
    report_ = static_cast<FaultReport*>(memory);
  }
  ~MappedReport() { munmap(report_, sizeof(FaultReport)); }
  MappedReport(const MappedReport&) = delete;
  MappedReport& operator=(const MappedReport&) = delete;

  void read(ProgramResult& result) const {
    for (size_t i = 0; i < kFaultCalls.size(); ++i) {
      if (report_->calls[i] > 0) result.calls.emplace(kFaultCalls[i], report_->calls[i]);
    }
    result.fired = report_->fired > 0;
    result.fired_on = report_->fired_on.data();
  }

 private:
  FaultReport* report_ = nullptr;
};

}  // namespace v3d::test
