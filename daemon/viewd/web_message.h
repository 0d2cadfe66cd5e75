// What is asked of v3d-viewd and what it answers, as plain values: between the pages, which know
// nothing of sockets, and the server, which knows nothing of takes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace v3d {

/// Fields of an HTTP request, empty where they were not sent.
struct WebRequest {
  std::string method = {};  ///< "GET"
  std::string target = {};  ///< "/takes/kendo-07/mesh.v3d?x=1"
  std::string host = {};    ///< the first, where there are several
  bool has_several_hosts = false;
  std::string origin = {};
  std::string range = {};
  std::string if_none_match = {};
  std::string cookie = {};
  std::string authorization = {};
  std::string content_type = {};
  std::string operator_token = {};  ///< the field X-V3D-Operator
  std::string address = {};         ///< whom it comes from: "10.0.7.2"
  std::string body = {};
  bool has_unread_body = false;  ///< it was too large, or of unknown size
};

/// A file that is open, closed with the last that has it.
class OpenFile {
 public:
  explicit OpenFile(int fd) : fd_(fd) {}
  ~OpenFile();
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int fd() const { return fd_; }

 private:
  const int fd_;
};

/// Bytes of a file. Shared: answers are copied on their way through the server.
struct FilePart {
  std::shared_ptr<const OpenFile> file;
  int64_t first = 0;
  int64_t size = 0;
};

struct WebAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body = {};
  std::optional<FilePart> file = {};  ///< instead of `body`
  std::vector<std::pair<std::string, std::string>> fields = {};
  /// Makes the answer, where that takes long: on another thread, one such at a time. Never throws,
  /// and what it returns has no work. All else counts for nothing then.
  std::function<WebAnswer()> work = {};
  /// With `work`: it lists folders, and this names what. Such work has a thread of its own, and
  /// requests for the same listing share one run (listing_runner.h).
  std::string listing = {};
};

/// One line.
inline WebAnswer plain_answer(int status, const std::string& text) {
  return {.status = status, .body = text + "\n"};
}
inline WebAnswer json_answer(std::string text) {
  return {.type = "application/json",
          .body = std::move(text),
          .fields = {{"Cache-Control", "no-store"}}};
}

/// A message of a WebSocket. Its bytes are made once and sent to everybody who watches: shared.
struct WebMessage {
  bool is_text = false;
  std::shared_ptr<const std::string> bytes;
};

/// What one who watches over a WebSocket has not been sent yet.
class WebStream {
 public:
  WebStream() = default;
  virtual ~WebStream() = default;
  WebStream(const WebStream&) = delete;
  WebStream& operator=(const WebStream&) = delete;
  /// The next message, of what there is now; empty when there is nothing new.
  virtual std::optional<WebMessage> next() = 0;
};

}  // namespace v3d
