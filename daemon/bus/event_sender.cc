#include "daemon/bus/event_sender.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>

#include "wire/channels.h"

namespace v3d {
namespace {

struct WithoutNumber {
  std::string rest;
  int64_t number = 0;  ///< 0 where there is none
};

/// "1,250 frames lost" is "frames lost" and 1250.
WithoutNumber without_number(const std::string& text) {
  constexpr size_t kMostDigits = 15;
  const size_t begin = text.find_first_of("0123456789");
  if (begin == std::string::npos) return {.rest = text};
  const size_t end = std::min(text.find_first_not_of("0123456789,", begin), text.size());
  std::string digits = text.substr(begin, end - begin);
  std::erase(digits, ',');
  return {.rest = text.substr(0, begin) + text.substr(end),
          .number = std::atoll(digits.substr(0, kMostDigits).c_str())};
}

}  // namespace

void EventSender::send(Severity severity, const std::string& subject, const std::string& text,
                       const std::string& advice) {
  const std::string sentence = advice.empty() ? text : text + ". " + advice;
  const auto level = severity == Severity::kInfo      ? spdlog::level::info
                     : severity == Severity::kWarning ? spdlog::level::warn
                                                      : spdlog::level::err;
  spdlog::log(level, "{}: {}", subject, sentence);
  bus_.publish_sealed(kEventChannel, encode(EventMessage{.sent = Realtime::now(),
                                                         .seq = seq_++,
                                                         .node = node_,
                                                         .severity = severity,
                                                         .subject = subject,
                                                         .text = sentence}));
}

void EventSender::keep_told(Severity severity, const std::string& subject, const std::string& text,
                            const std::string& advice, MonotonicInstant now) {
  Told& told = told_[subject];
  if (text == told.text) return;
  const bool same_trouble = without_number(text).rest == without_number(told.text).rest;
  if (!same_trouble) told.number = {};
  told.text = text;
  if (text.empty()) return send(Severity::kInfo, subject, "well again");
  const bool is_news = told.number.is_news(without_number(text).number, now);
  if (is_news || !same_trouble) send(severity, subject, text, advice);
}

}  // namespace v3d
