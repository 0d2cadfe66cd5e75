// Runs listings of folders on a thread of their own, so that a slow disk keeps only those waiting
// that asked for a listing. Uses Boost.Asio, as
// web_server.cc and web_connection.h do.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>

#include "daemon/viewd/web_message.h"

namespace v3d {

/// At most one listing runs at a time, and one run of a listing answers all who wait for it.
/// Who has waited for `within` is answered by 503; the run goes on, and later requests join it.
class ListingRunner {
 public:
  using Done = std::function<void(WebAnswer)>;
  static constexpr size_t kMaxWaiting = 64;

  /// `io` outlives it, and has stopped before it is destroyed, which waits for the run under way.
  ListingRunner(boost::asio::io_context& io, std::chrono::nanoseconds within)
      : io_(io), within_(within) {}
  ~ListingRunner();
  ListingRunner(const ListingRunner&) = delete;
  ListingRunner& operator=(const ListingRunner&) = delete;

  /// Calls `done` on the thread of `io` with what `work` makes, or with 503 after `within`. Joins
  /// the run of that name, where one is under way. False when too many wait. On the thread of `io`.
  bool run(const std::string& name, std::function<WebAnswer()> work, Done done);

 private:
  struct Waiter {
    Waiter(boost::asio::io_context& io, Done on_answer)
        : deadline(io), done(std::move(on_answer)) {}
    boost::asio::steady_timer deadline;
    Done done;
  };
  using Waiters = std::list<std::shared_ptr<Waiter>>;

  void start(const std::string& name, std::function<WebAnswer()> work);
  void finish(const std::string& name, const WebAnswer& answer);
  void give_up(const std::string& name, const std::shared_ptr<Waiter>& waiter);

  boost::asio::io_context& io_;
  const std::chrono::nanoseconds within_;
  std::map<std::string, Waiters> runs_;  ///< under way, or waiting for the thread
  size_t waiting_ = 0;
  boost::asio::thread_pool thread_{1};
};

}  // namespace v3d
