#include "daemon/web/work_runner.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

namespace v3d::web {

WorkRunner::~WorkRunner() {
  if (!threads_) return;
  threads_->stop();
  threads_->join();
}

bool WorkRunner::run(std::string name, std::function<WebResponse()> work, Done done) {
  if (waiting_ >= limits_.max_waiting || runs_.size() >= limits_.max_waiting) return false;
  if (name.empty()) name = "#" + std::to_string(unnamed_++);
  const auto waiter = std::make_shared<Waiter>(io_, std::move(done));
  const bool is_new = !runs_.contains(name);
  runs_[name].push_back(waiter);
  ++waiting_;
  waiter->deadline.expires_after(limits_.timeout);
  waiter->deadline.async_wait([this, name, waiter](boost::system::error_code stopped) {
    if (!stopped) time_out(name, waiter);
  });
  if (is_new) start(name, std::move(work));
  return true;
}

void WorkRunner::start(const std::string& name, std::function<WebResponse()> work) {
  if (!threads_) threads_.emplace(limits_.threads);
  boost::asio::post(*threads_, [this, name, work = std::move(work)] {
    boost::asio::post(io_, [this, name, response = work()] { finish(name, response); });
  });
}

void WorkRunner::finish(const std::string& name, const WebResponse& response) {
  const Waiters waiters = std::move(runs_[name]);
  runs_.erase(name);
  waiting_ -= waiters.size();
  for (const auto& waiter : waiters) {
    waiter->deadline.cancel();
    waiter->done(response);
  }
}

void WorkRunner::time_out(const std::string& name, const std::shared_ptr<Waiter>& waiter) {
  const auto run = runs_.find(name);
  if (run == runs_.end() || std::erase(run->second, waiter) == 0) return;  // has been answered
  --waiting_;
  WebResponse response = plain_response(503, limits_.late);
  response.fields = {{"Retry-After", "5"}};
  waiter->done(std::move(response));
}

}  // namespace v3d::web
