// Interface of the content that a WebServer serves.
#pragma once

#include <cstdint>
#include <memory>

#include "daemon/web/web_message.h"

namespace v3d {

/// The permission of the last request of a connection.
enum class ClientRole : uint8_t {
  kUnauthenticated,  ///< no request yet, or one whose sender is rejected
  kViewer,           ///< a request that is allowed
  kOperator          ///< such a request with the operators' token
};

/// Answers requests. Used on the server's thread only.
class WebHandler {
 public:
  WebHandler() = default;
  virtual ~WebHandler() = default;
  WebHandler(const WebHandler&) = delete;
  WebHandler& operator=(const WebHandler&) = delete;

  /// Must not throw.
  virtual WebAnswer answer(const WebRequest& request) = 0;
  /// kUnauthenticated if answer() would refuse any request of this sender.
  virtual ClientRole role_of(const WebRequest& request) const = 0;

  /// The result of a request to open a WebSocket: the stream, or the refusal.
  struct Opening {
    std::unique_ptr<WebStream> stream;
    WebAnswer refusal;
  };
  virtual Opening open_stream(const WebRequest& request) = 0;
};

}  // namespace v3d
