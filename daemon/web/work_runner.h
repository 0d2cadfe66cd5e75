// Runs the work of responses that may wait for a disk, on threads of its own. Uses Boost.Asio.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "daemon/web/web_message.h"

namespace v3d::web {

/// Limits of the work of one kind (WorkKind).
struct WorkLimits {
  size_t threads = 1;
  size_t max_waiting = 64;  ///< requests, and works that run or wait for a thread
  std::chrono::nanoseconds timeout{};
  std::string late;  ///< the response to a request after the timeout, one line
};

/// Requests of one name share a run that runs or waits. A request gets 503 after the timeout. Its
/// work continues; a later request of its name joins it.
class WorkRunner {
 public:
  using Done = std::function<void(WebResponse)>;

  /// `io` must outlive this object, and must be stopped before its destruction. The first run()
  /// starts the threads; the destructor waits for the work that runs.
  WorkRunner(boost::asio::io_context& io, WorkLimits limits)
      : io_(io), limits_(std::move(limits)) {}
  ~WorkRunner();
  WorkRunner(const WorkRunner&) = delete;
  WorkRunner& operator=(const WorkRunner&) = delete;

  /// Calls `done` on the thread of `io` with the result of `work`, or with 503 after the timeout.
  /// `name`: empty for work that is not shared. Returns false when max_waiting is reached. Call it
  /// on the thread of `io`.
  bool run(std::string name, std::function<WebResponse()> work, Done done);

 private:
  struct Waiter {
    Waiter(boost::asio::io_context& io, Done on_response)
        : deadline(io), done(std::move(on_response)) {}
    boost::asio::steady_timer deadline;
    Done done;
  };
  using Waiters = std::list<std::shared_ptr<Waiter>>;

  void start(const std::string& name, std::function<WebResponse()> work);
  void finish(const std::string& name, const WebResponse& response);
  void time_out(const std::string& name, const std::shared_ptr<Waiter>& waiter);

  boost::asio::io_context& io_;
  const WorkLimits limits_;
  std::map<std::string, Waiters> runs_;  ///< by name: running, or waiting for a thread
  size_t waiting_ = 0;
  int64_t unnamed_ = 0;  ///< number of works without a name until now
  std::optional<boost::asio::thread_pool> threads_;
};

}  // namespace v3d::web
