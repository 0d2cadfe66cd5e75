#include "daemon/event_sender.h"

#include <spdlog/spdlog.h>

#include "wire/channels.h"

namespace v3d {

void EventSender::send(Severity severity, const std::string& subject, const std::string& text,
                       const std::string& advice) {
  const std::string sentence = advice.empty() ? text : text + ". " + advice;
  const auto level = severity == Severity::kInfo      ? spdlog::level::info
                     : severity == Severity::kWarning ? spdlog::level::warn
                                                      : spdlog::level::err;
  spdlog::log(level, "{}: {}", subject, sentence);
  bus_.publish(kEventChannel, encode(EventMessage{.sent = Realtime::now(),
                                                  .seq = seq_++,
                                                  .node = node_,
                                                  .severity = severity,
                                                  .subject = subject,
                                                  .text = sentence}));
}

void EventSender::keep_told(Severity severity, const std::string& subject, const std::string& text,
                            const std::string& advice) {
  std::string& told = told_[subject];
  if (text == told) return;
  if (text.empty()) {
    send(Severity::kInfo, subject, "well again");
  } else {
    send(severity, subject, text, advice);
  }
  told = text;
}

}  // namespace v3d
