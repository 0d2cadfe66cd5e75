#include "daemon/web/listing_runner.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

namespace v3d {

ListingRunner::~ListingRunner() {
  thread_.stop();
  thread_.join();
}

bool ListingRunner::run(const std::string& name, std::function<WebAnswer()> work, Done done) {
  if (waiting_ >= kMaxWaiting) return false;
  const auto waiter = std::make_shared<Waiter>(io_, std::move(done));
  const bool is_new = !runs_.contains(name);
  runs_[name].push_back(waiter);
  ++waiting_;
  waiter->deadline.expires_after(timeout_);
  waiter->deadline.async_wait([this, name, waiter](boost::system::error_code stopped) {
    if (!stopped) time_out(name, waiter);
  });
  if (is_new) start(name, std::move(work));
  return true;
}

void ListingRunner::start(const std::string& name, std::function<WebAnswer()> work) {
  boost::asio::post(thread_, [this, name, work = std::move(work)] {
    boost::asio::post(io_, [this, name, answer = work()] { finish(name, answer); });
  });
}

void ListingRunner::finish(const std::string& name, const WebAnswer& answer) {
  const Waiters waiters = std::move(runs_[name]);
  runs_.erase(name);
  waiting_ -= waiters.size();
  for (const auto& waiter : waiters) {
    waiter->deadline.cancel();
    waiter->done(answer);
  }
}

void ListingRunner::time_out(const std::string& name, const std::shared_ptr<Waiter>& waiter) {
  const auto run = runs_.find(name);
  if (run == runs_.end() || std::erase(run->second, waiter) == 0) return;  // has been answered
  --waiting_;
  WebAnswer answer = plain_answer(503, "the disk is slow to list its folders; try again");
  answer.fields = {{"Retry-After", "5"}};
  waiter->done(std::move(answer));
}

}  // namespace v3d
