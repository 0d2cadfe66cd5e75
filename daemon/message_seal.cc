#include "daemon/message_seal.h"

#include <cmath>
#include <cstdio>

namespace v3d {
namespace {

/// So long a refusal is worth a line in health.
constexpr Duration kTold = std::chrono::seconds(10);

}  // namespace

void MessageSeal::set_key(const StudioKey& key) {
  const std::lock_guard lock(mutex_);
  mac_ = std::make_shared<const DatagramMac>(key);
  has_key_ = true;
}

std::shared_ptr<const DatagramMac> MessageSeal::mac() const {
  if (!has_key_) return nullptr;
  const std::lock_guard lock(mutex_);
  return mac_;
}

void MessageSeal::count_forged() {
  ++forged_;
  report(
      "messages without the studio's seal are refused: a stranger, or another studio key than "
      "here");
}

void MessageSeal::count_stale(Duration age) {
  ++stale_;
  char text[120];
  std::snprintf(text, sizeof text,
                "messages are refused that were sent %.1f s %s; do the clocks agree? Try: chronyc "
                "tracking",
                std::abs(to_seconds(age)), age > Duration::zero() ? "ago" : "in the future");
  report(text);
}

SealCounts MessageSeal::counts() const {
  return {.forged = forged_, .stale = stale_, .replayed = replayed_};
}

std::string MessageSeal::trouble(RealtimeInstant now) const {
  const std::lock_guard lock(mutex_);
  return now - troubled_ < kTold ? trouble_ : "";
}

void MessageSeal::report(std::string_view trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  troubled_ = Realtime::now();
}

NewsGate::Verdict NewsGate::judge(const std::string& sender, int64_t seq, RealtimeInstant sent,
                                  RealtimeInstant now) {
  const Duration age = now - sent;
  if (age > kOldest || -age > kAhead) return Verdict::kStale;
  // Who holds the key invents no senders; should they ever be so many, none is news.
  if (senders_.size() == kMaxSenders && !senders_.contains(sender)) return Verdict::kStale;
  Heard& heard = senders_[sender];
  if (sent <= heard.floor) return Verdict::kStale;
  if (!heard.messages.emplace(sent, seq).second) return Verdict::kHeard;
  while (heard.messages.size() > kRemembered || heard.messages.begin()->first < now - kOldest) {
    heard.floor = heard.messages.begin()->first;
    heard.messages.erase(heard.messages.begin());
  }
  return Verdict::kNews;
}

}  // namespace v3d
