#include "daemon/viewd/live_feed.h"

#include <algorithm>

#include "codec/frame_header.h"
#include "daemon/viewd/view_json.h"

namespace v3d {

class LiveFeed::Subscriber : public WebStream {
 public:
  explicit Subscriber(LiveFeed& feed) : feed_(feed) {}

  std::optional<WebMessage> next() override {
    if (feed_.group_.empty()) return {};
    const int64_t key = feed_.group_.front().number;
    const int64_t number = std::max(next_, key);
    const auto at = static_cast<size_t>(number - key);
    if (at >= feed_.group_.size()) return {};
    if (next_ >= 0) feed_.counts_.skipped += number - next_;
    next_ = number + 1;
    return WebMessage{.is_text = false, .bytes = feed_.group_[at].message};
  }

 private:
  LiveFeed& feed_;
  int64_t next_ = -1;  ///< -1: the key frame
};

void LiveFeed::clear_group() {
  group_.clear();
  group_bytes_ = 0;
}

bool LiveFeed::follows(uint32_t reference, int64_t key_pulse) const {
  return !group_.empty() && group_.back().checksum == reference && key_pulse_ == key_pulse &&
         group_.size() < kMaxFrames && group_bytes_ < kMaxBytes;
}

/// A lower pulse number that is sent 5 s later belongs to a new take of the same name.
bool LiveFeed::is_outdated(const MeshMessage& mesh) const {
  constexpr Duration kNewTakeAfter = std::chrono::seconds(5);
  return mesh.take == take_ && mesh.pulse <= pulse_ && mesh.sent - sent_ < kNewTakeAfter;
}

void LiveFeed::add(const MeshMessage& mesh) {
  ++counts_.frames;
  const auto header = read_header(mesh.compact);
  if (!header) {
    ++counts_.unusable;
    return;
  }
  if (is_outdated(mesh)) {
    ++counts_.outdated;
    return;
  }
  take_ = mesh.take;
  pulse_ = mesh.pulse;
  sent_ = mesh.sent;
  const bool is_key = !header->is(FrameHeader::kInter);
  if (!is_key && !follows(header->reference, header->key_pulse)) {
    // Frames that follow need this one, so drop the group until the next key frame.
    clear_group();
    ++counts_.unusable;
    return;
  }
  if (is_key) clear_group();
  key_pulse_ = header->key_pulse;
  auto message = std::make_shared<const std::string>(mesh_message(mesh, next_number_));
  group_bytes_ += message->size();
  group_.push_back({next_number_++, header->checksum, std::move(message)});
}

std::unique_ptr<WebStream> LiveFeed::subscribe() { return std::make_unique<Subscriber>(*this); }

}  // namespace v3d
