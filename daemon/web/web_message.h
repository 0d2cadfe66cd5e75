// Requests, responses and their handler.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/io/unique_fd.h"

namespace v3d::web {

// HTTP requests, responses and WebSocket messages as plain values: the interface between the site,
// which uses no sockets, and the server, which does not depend on takes.

/// An HTTP request. Fields that were not sent are empty.
struct WebRequest {
  std::string method = {};  ///< "GET"
  std::string target = {};  ///< "/takes/kendo-07/mesh.v3d?x=1"
  std::string host = {};    ///< the first, if there are several
  bool has_several_hosts = false;
  std::string origin = {};
  std::string range = {};
  std::string if_range = {};
  std::string if_none_match = {};
  std::string cookie = {};
  std::string authorization = {};
  std::string content_type = {};
  std::string operator_token = {};  ///< the field X-V3D-Operator
  std::string address = {};         ///< of the client: "10.0.7.2"
  std::string body = {};
  bool has_unread_body = false;  ///< the body was too large, or of unknown size
};

/// Work that may wait for a disk, by the threads that do it. A slow or hanging disk delays only
/// work of the same kind.
enum class WorkKind : uint8_t {
  kListing,    ///< lists folders; requests for the same listing share one run
  kPicture,    ///< reads and computes pictures, one at a time
  kThumbnail,  ///< reads small pictures of takes, one at a time
  kFile,       ///< reads files of takes
  kPage        ///< reads files of the page
};

/// A part of a file. Copies share the open file.
struct FilePart {
  std::shared_ptr<const io::UniqueFd> file;
  int64_t first = 0;
  int64_t size = 0;
  WorkKind kind = WorkKind::kFile;  ///< of the work that reads it
};

struct WebResponse {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body = {};
  std::optional<FilePart> file = {};  ///< instead of `body`
  std::vector<std::pair<std::string, std::string>> fields = {};
  /// Makes the response, if that may take long or reads from a disk. Runs on another thread. Must
  /// not throw or return a response with work. The other fields are then ignored, except `kind` and
  /// `listing`.
  std::function<WebResponse()> work = {};
  WorkKind kind = WorkKind::kFile;
  std::string listing = {};  ///< requests with this name share one run of the work; empty: none
};

/// A response of one line of text.
inline WebResponse plain_response(int status, const std::string& text) {
  return {.status = status, .body = text + "\n"};
}
inline WebResponse json_response(std::string text) {
  return {.type = "application/json",
          .body = std::move(text),
          .fields = {{"Cache-Control", "no-store"}}};
}

/// A WebSocket message. Subscribers share its bytes.
struct WebMessage {
  bool is_text = false;
  std::shared_ptr<const std::string> bytes;
};

/// The messages for one WebSocket client.
class WebStream {
 public:
  WebStream() = default;
  virtual ~WebStream() = default;
  WebStream(const WebStream&) = delete;
  WebStream& operator=(const WebStream&) = delete;
  /// The next message from the current state; empty if there is nothing new.
  virtual std::optional<WebMessage> next() = 0;
};

// Interface of the content that a WebServer serves.

/// The permission of the last request of a connection.
enum class ClientRole : uint8_t {
  kUnauthenticated,  ///< no request yet, or one whose sender is rejected
  kViewer,           ///< a request that is allowed
  kOperator          ///< such a request with the operators' token
};

/// Responds to requests. Used on the server's thread only.
class WebHandler {
 public:
  WebHandler() = default;
  virtual ~WebHandler() = default;
  WebHandler(const WebHandler&) = delete;
  WebHandler& operator=(const WebHandler&) = delete;

  /// Must not throw.
  virtual WebResponse respond(const WebRequest& request) = 0;
  /// kUnauthenticated if respond() would reject any request of this sender.
  virtual ClientRole role_of(const WebRequest& request) const = 0;

  /// The result of a request to open a WebSocket: the stream, or the refusal.
  struct Opening {
    std::unique_ptr<WebStream> stream;
    WebResponse refusal;
  };
  virtual Opening open_stream(const WebRequest& request) = 0;
};

}  // namespace v3d::web
