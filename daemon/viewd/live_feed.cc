#include "daemon/viewd/live_feed.h"

#include <algorithm>

#include "codec/frame_header.h"
#include "daemon/viewd/view_json.h"

namespace v3d {

class LiveFeed::Watcher : public WebStream {
 public:
  explicit Watcher(LiveFeed& feed) : feed_(feed) {}

  std::optional<WebMessage> next() override {
    if (feed_.group_.empty()) return {};
    const int64_t key = feed_.group_.front().number;
    const int64_t number = std::max(wanted_, key);
    const auto at = static_cast<size_t>(number - key);
    if (at >= feed_.group_.size()) return {};
    if (wanted_ >= 0) feed_.counts_.skipped += number - wanted_;
    wanted_ = number + 1;
    return WebMessage{.is_text = false, .bytes = feed_.group_[at].message};
  }

 private:
  LiveFeed& feed_;
  int64_t wanted_ = -1;  ///< at first, whatever there is
};

void LiveFeed::begin_group() {
  group_.clear();
  group_bytes_ = 0;
}

bool LiveFeed::follows(uint32_t reference, int64_t key_pulse) const {
  return !group_.empty() && group_.back().checksum == reference && key_pulse_ == key_pulse &&
         group_.size() < kMaxFrames && group_bytes_ < kMaxBytes;
}

/// A take of the same name that begins again, later, is none that goes back.
bool LiveFeed::goes_back(const MeshMessage& mesh) const {
  constexpr Duration kAnotherTime = std::chrono::seconds(5);
  return mesh.take == take_ && mesh.pulse <= pulse_ && mesh.sent - sent_ < kAnotherTime;
}

void LiveFeed::add(const MeshMessage& mesh) {
  ++counts_.frames;
  const auto header = read_header(mesh.compact);
  if (!header) {
    ++counts_.unusable;
    return;
  }
  if (goes_back(mesh)) {
    ++counts_.returned;
    return;
  }
  take_ = mesh.take;
  pulse_ = mesh.pulse;
  sent_ = mesh.sent;
  const bool is_key = !header->is(FrameHeader::kInter);
  if (!is_key && !follows(header->reference, header->key_pulse)) {
    // Whoever watches keeps what he has; the group is over, for what follows lacks this one.
    begin_group();
    ++counts_.unusable;
    return;
  }
  if (is_key) begin_group();
  key_pulse_ = header->key_pulse;
  auto message = std::make_shared<const std::string>(mesh_message(mesh, numbers_));
  group_bytes_ += message->size();
  group_.push_back({numbers_++, header->checksum, std::move(message)});
}

std::unique_ptr<WebStream> LiveFeed::watch() { return std::make_unique<Watcher>(*this); }

}  // namespace v3d
