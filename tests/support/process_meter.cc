#include "support/process_meter.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "base/core/statistics.h"
#include "support/child_process.h"

namespace v3d::test {
namespace {

int64_t entries_of(const std::string& folder) {
  std::error_code error;
  int64_t n = 0;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    ++n;
  }
  return n;
}

/// User and system time, fields 14 and 15 of proc(5)'s stat. The name in field 2 may hold spaces.
double processor_seconds(const std::string& folder) {
  std::ifstream file(folder + "/stat");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  const size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return 0;
  std::istringstream fields(text.substr(name_end + 1));
  std::string skipped;
  for (int field = 3; field < 14; ++field) fields >> skipped;
  double user = 0, system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace

ProcessSample sample(pid_t process) {
  const std::string folder = "/proc/" + std::to_string(process);
  ProcessSample sample;
  std::ifstream rollup(folder + "/smaps_rollup");
  for (std::string word; rollup >> word;) {
    if (word == "Rss:") {
      rollup >> sample.resident_kb;
      break;
    }
  }
  sample.processor_s = processor_seconds(folder);
  sample.descriptors = entries_of(folder + "/fd");
  sample.threads = entries_of(folder + "/task");
  return sample;
}

ProcessMeter::ProcessMeter(pid_t process) : process_(process), start_(Monotonic::now()) {
  thread_ = std::thread([this] {
    while (!stopping_) {
      ProcessSample now = sample(process_);
      now.seconds = this->now();
      {
        const std::lock_guard lock(mutex_);
        samples_.push_back(now);
      }
      const MonotonicInstant next = Monotonic::now() + std::chrono::milliseconds(500);
      becomes_true([&] { return stopping_ || Monotonic::now() >= next; }, next);
    }
  });
}

ProcessMeter::~ProcessMeter() {
  stopping_ = true;
  thread_.join();
}

double ProcessMeter::now() const { return to_seconds(Monotonic::now() - start_); }

std::vector<ProcessSample> ProcessMeter::since(double from) const {
  const std::lock_guard lock(mutex_);
  std::vector<ProcessSample> later;
  std::copy_if(samples_.begin(), samples_.end(), std::back_inserter(later),
               [&](const ProcessSample& s) { return s.seconds >= from; });
  return later;
}

double resident_kb_per_hour(const std::vector<ProcessSample>& samples) {
  std::vector<double> slopes;
  for (size_t i = 0; i < samples.size(); ++i) {
    for (size_t j = i + 1; j < samples.size(); ++j) {
      slopes.push_back((samples[j].resident_kb - samples[i].resident_kb) /
                       (samples[j].seconds - samples[i].seconds));
    }
  }
  return 3600 * upper_median(std::move(slopes));
}

}  // namespace v3d::test
