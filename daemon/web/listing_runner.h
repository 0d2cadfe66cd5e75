// Runs listings of folders on a thread of their own, so that a slow disk delays only requests for
// listings. Uses Boost.Asio.
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

#include "daemon/web/web_message.h"

namespace v3d {

/// At most one listing runs at a time. Requests for a listing that already runs or waits share its
/// result. A request gets 503 after `timeout`; the listing continues, and later requests join it.
class ListingRunner {
 public:
  using Done = std::function<void(WebAnswer)>;
  static constexpr size_t kMaxWaiting = 64;

  /// `io` must outlive this object, and must be stopped before its destruction. The destructor
  /// waits for the listing that runs.
  ListingRunner(boost::asio::io_context& io, std::chrono::nanoseconds timeout)
      : io_(io), timeout_(timeout) {}
  ~ListingRunner();
  ListingRunner(const ListingRunner&) = delete;
  ListingRunner& operator=(const ListingRunner&) = delete;

  /// Calls `done` on the thread of `io` with the result of `work`, or with 503 after the timeout.
  /// Joins the listing `name` if it already runs. Returns false if kMaxWaiting requests wait. Call
  /// it on the thread of `io`.
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
  void time_out(const std::string& name, const std::shared_ptr<Waiter>& waiter);

  boost::asio::io_context& io_;
  const std::chrono::nanoseconds timeout_;
  std::map<std::string, Waiters> runs_;  ///< by name: running, or waiting for the thread
  size_t waiting_ = 0;
  boost::asio::thread_pool thread_{1};
};

}  // namespace v3d
