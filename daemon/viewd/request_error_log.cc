#include "daemon/viewd/request_error_log.h"

#include <spdlog/spdlog.h>

#include <utility>

namespace v3d::viewd {

std::optional<std::string> RequestErrorLog::line(const std::string& text, MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  File& file = file_of(text, now);
  file.last_error = now;
  if (!file.lines.is_report_due(++file.errors, now)) return {};
  const int64_t left_out = file.errors - std::exchange(file.logged, file.errors) - 1;
  if (left_out == 0) return text;
  return text + " (errors of this file that were not logged: " + std::to_string(left_out) + ")";
}

/// Forgets files without an error in the last minute where there are kMaxFiles.
RequestErrorLog::File& RequestErrorLog::file_of(const std::string& text, MonotonicInstant now) {
  const std::string path = text.substr(0, text.find(": "));
  const auto known = files_.find(path);
  if (known != files_.end()) return known->second;
  if (files_.size() >= kMaxFiles) {
    std::erase_if(files_, [&](const auto& file) {
      return now - file.second.last_error >= bus::EventThrottle::kAgainAfter;
    });
  }
  return files_[files_.size() < kMaxFiles ? path : ""];
}

namespace {

void log_limited(spdlog::level::level_enum level, const std::string& text) {
  static RequestErrorLog errors;
  if (const auto line = errors.line(text, Monotonic::now())) spdlog::log(level, "{}", *line);
}

}  // namespace

void log_request_error(const std::string& text) { log_limited(spdlog::level::warn, text); }
void log_internal_error(const std::string& text) { log_limited(spdlog::level::err, text); }

}  // namespace v3d::viewd
