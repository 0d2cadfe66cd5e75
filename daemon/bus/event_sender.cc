#include "daemon/bus/event_sender.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>

#include "daemon/bus/channel_list.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

/// Of an event, without its advice, in bytes: receivers drop events of 32 KiB.
constexpr size_t kMaxText = size_t{8} << 10;

struct SplitText {
  std::string words;   ///< without the number
  int64_t number = 0;  ///< 0 when there is none
};

/// Splits off the first number that is a word: "1,250 frames lost" is " frames lost" and 1250.
/// Digits of a name or a path, "/data2", are no number.
SplitText split_number(const std::string& text) {
  constexpr size_t kMaxDigits = 15;
  constexpr char kDigits[] = "0123456789";
  size_t begin = text.find_first_of(kDigits);
  while (begin != std::string::npos && begin > 0 && text[begin - 1] != ' ') {
    begin = text.find_first_of(kDigits, begin + 1);
  }
  if (begin == std::string::npos) return {.words = text};
  const size_t end = std::min(text.find_first_not_of("0123456789,", begin), text.size());
  std::string digits = text.substr(begin, end - begin);
  std::erase(digits, ',');
  return {.words = text.substr(0, begin) + text.substr(end),
          .number = std::atoll(digits.substr(0, kMaxDigits).c_str())};
}

}  // namespace

void EventSender::send(wire::Severity severity, const std::string& subject, const std::string& text,
                       const std::string& advice) {
  const std::string what = shortened(text, kMaxText);
  const std::string sentence = advice.empty() ? what : what + ". " + advice;
  const auto level = severity == wire::Severity::kInfo      ? spdlog::level::info
                     : severity == wire::Severity::kWarning ? spdlog::level::warn
                                                            : spdlog::level::err;
  spdlog::log(level, "{}: {}", subject, sentence);
  bus_.publish_authenticated(wire::kEventChannel, encode(wire::EventMessage{.sent = Realtime::now(),
                                                                            .seq = seq_++,
                                                                            .node = node_,
                                                                            .severity = severity,
                                                                            .subject = subject,
                                                                            .text = sentence}));
}

void EventSender::report_condition(wire::Severity severity, const std::string& subject,
                                   const std::string& text, const std::string& advice,
                                   MonotonicInstant now) {
  Condition& condition = conditions_[subject];
  if (text == condition.reported) return;
  const bool is_same = split_number(text).words == split_number(condition.reported).words;
  if (!is_same) condition.number = {};
  const bool is_due = condition.number.is_report_due(split_number(text).number, now);
  if (!is_due && is_same) return;  // due later, although the text may stay
  condition.reported = text;
  if (text.empty()) return send(wire::Severity::kInfo, subject, "the problem has ended");
  send(severity, subject, text, advice);
}

}  // namespace v3d::bus
