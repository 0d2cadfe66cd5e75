#include "take/ledger/hashed_file.h"

#include <algorithm>
#include <cerrno>
#include <span>
#include <vector>

#include "base/io/big_endian.h"
#include "base/io/file.h"
#include "take/logs/event_log.h"
#include "take/logs/sparse_file.h"

namespace v3d {
namespace {

constexpr uint64_t kBlock = 1 << 20;
constexpr uint32_t kMaxChannelBytes = 256;

class FileTree {
 public:
  FileTree(const io::File& file, uint64_t size, bool is_log, const MayContinue& may_continue)
      : file_(file), reader_(file), size_(size), is_log_(is_log), may_continue_(may_continue) {}

  io::Result<Hash> root() {
    HashTree tree;
    for (uint64_t at = 0; at < size_;) {
      const auto length = leaf_length(at);
      if (!length) return tl::make_unexpected(length.error());
      const auto leaf = hash(at, *length);
      if (!leaf) return tl::make_unexpected(leaf.error());
      tree.add(*leaf);
      at += *length;
    }
    return tree.root();
  }

 private:
  io::Result<uint64_t> leaf_length(uint64_t at) {
    const uint64_t block = std::min(kBlock, size_ - at);
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
        channel <= kMaxChannelBytes && data <= kMaxEventBytes && event <= size_ - at;
    return is_event ? event : block;
  }

  io::Result<Hash> hash(uint64_t at, uint64_t length) {
    LeafHash leaf;
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
  const uint64_t size_;
  const bool is_log_;
  const MayContinue& may_continue_;
  std::vector<uint8_t> chunk_ = std::vector<uint8_t>(kBlock);
};

}  // namespace

io::Result<TakeFile> hash_take_file(const TakePaths& paths, const std::string& name, int64_t bytes,
                                    const MayContinue& may_continue) {
  const auto file = io::File::open(paths.folder / name, io::OpenMode::kReadWithinFolder);
  if (!file) return tl::make_unexpected(file.error());
  const auto size = file->size();
  if (!size) return tl::make_unexpected(size.error());
  TakeFile hashed{.name = name, .bytes = static_cast<int64_t>(*size), .checksum = {}};
  if (hashed.bytes != bytes) return hashed;
  const auto root = FileTree(*file, *size, name.ends_with(".lcmlog"), may_continue).root();
  if (!root) return tl::make_unexpected(root.error());
  hashed.root = *root;
  return hashed;
}

}  // namespace v3d
