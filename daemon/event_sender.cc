#include "daemon/event_sender.h"

#include <spdlog/spdlog.h>

#include "wire/channels.h"

namespace v3d {

void EventSender::send(Severity severity, const std::string& subject, const std::string& text) {
  const auto level = severity == Severity::kInfo      ? spdlog::level::info
                     : severity == Severity::kWarning ? spdlog::level::warn
                                                      : spdlog::level::err;
  spdlog::log(level, "{}: {}", subject, text);
  bus_.publish(kEventChannel, encode(EventMessage{.sent = Realtime::now(),
                                                  .seq = seq_++,
                                                  .node = node_,
                                                  .severity = severity,
                                                  .subject = subject,
                                                  .text = text}));
}

}  // namespace v3d
