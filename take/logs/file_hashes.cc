#include "take/logs/file_hashes.h"

#include <algorithm>
#include <cerrno>
#include <span>
#include <vector>

#include "take/logs/event_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

constexpr uint64_t kBlock = 1 << 20;
constexpr uint32_t kMaxChannelBytes = 256;

class LeafReader {
 public:
  LeafReader(const io::File& file, FileRange bytes, const MayContinue& may_continue)
      : file_(file),
        reader_(file),
        bytes_(bytes),
        is_log_(file.path().native().ends_with(".lcmlog")),
        may_continue_(may_continue) {}

  io::Status add_to(wire::HashTree& tree) {
    for (uint64_t at = bytes_.begin; at < bytes_.end;) {
      const auto length = leaf_length(at);
      if (!length) return tl::make_unexpected(length.error());
      const auto leaf = hash(at, *length);
      if (!leaf) return tl::make_unexpected(leaf.error());
      tree.add(*leaf);
      at += *length;
    }
    return {};
  }

 private:
  io::Result<uint64_t> leaf_length(uint64_t at) {
    const uint64_t block = std::min(kBlock, bytes_.end - at);
    if (!is_log_ || block < kEventHeaderSize) return block;
    const auto got = file_.read(at, std::span(chunk_).first(kEventHeaderSize));
    if (!got) return tl::make_unexpected(got.error());
    const auto number = [&](size_t offset) {
      return read_big_endian(std::span(chunk_).subspan(offset, 4));
    };
    if (*got < kEventHeaderSize || number(0) != kEventSyncWord) return block;
    const uint64_t channel = number(20), data = number(24);
    const uint64_t event = kEventHeaderSize + channel + data;
    const bool is_event =
        channel <= kMaxChannelBytes && data <= kMaxEventBytes && event <= bytes_.end - at;
    return is_event ? event : block;
  }

  io::Result<wire::Hash> hash(uint64_t at, uint64_t length) {
    wire::LeafHash leaf;
    for (const uint64_t end = at + length; at < end;) {
      if (may_continue_ && !may_continue_()) {
        return io::io_error("read", file_.path(), "stopped", ECANCELED);
      }
      const auto block = std::span(chunk_).first(std::min(kBlock, end - at));
      if (const auto read = reader_.read_whole(at, block); !read) {
        return tl::make_unexpected(read.error());
      }
      leaf.add(block);
      at += block.size();
    }
    return leaf.value();
  }

  const io::File& file_;
  SparseReader reader_;
  const FileRange bytes_;
  const bool is_log_;
  const MayContinue& may_continue_;
  std::vector<uint8_t> chunk_ = std::vector<uint8_t>(kBlock);
};

}  // namespace

io::Status add_to_checksum(const io::File& file, FileRange bytes, RunningChecksum& sum,
                           const ReadProgress& progress) {
  std::vector<uint8_t> chunk(kBlock);
  SparseReader reader(file);
  for (uint64_t at = bytes.begin; at < bytes.end; at += kBlock) {
    if (progress) progress();
    const auto part = std::span(chunk).first(std::min(kBlock, bytes.end - at));
    if (auto read = reader.read_whole(at, part); !read) return read;
    sum.add(part);
  }
  return {};
}

io::Status add_to_tree(const io::File& file, FileRange bytes, wire::HashTree& tree,
                       const MayContinue& may_continue) {
  return LeafReader(file, bytes, may_continue).add_to(tree);
}

}  // namespace v3d::take
