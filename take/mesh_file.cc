#include "take/mesh_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <deque>
#include <utility>

#include "base/error.h"
#include "take/mesh_file_layout.h"
#include "take/pulse_set.h"

namespace v3d {
namespace {

using mesh_file::Entry;

bool write_all(int fd, uint64_t offset, std::span<const uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(n));
    offset += static_cast<uint64_t>(n);
  }
  return true;
}

/// Fewer bytes than asked for at the end of the file.
std::vector<uint8_t> read_at(int fd, uint64_t offset, size_t size) {
  std::vector<uint8_t> bytes(size);
  size_t done = 0;
  while (done < size) {
    const ssize_t n =
        pread(fd, bytes.data() + done, size - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<size_t>(n);
  }
  bytes.resize(done);
  return bytes;
}

/// A mesh file and where everything in it lies.
class IndexedFile {
 public:
  explicit IndexedFile(const std::filesystem::path& path)
      : fd_(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (fd_ < 0) throw InputError(errno_message("cannot open mesh file " + path.string()));
    struct stat status {};
    if (fstat(fd_, &status) == 0) file_size_ = static_cast<uint64_t>(status.st_size);
    const auto head = read_at(fd_, 0, mesh_file::kHeaderSize);
    if (head.size() < mesh_file::kHeaderSize ||
        !mesh_file::magic_at(head, 0, mesh_file::kFileMagic)) {
      refuse(path.string() + ": is no mesh file (mesh.v3d)");
    }
    if (mesh_file::u32_at(head, 8) != mesh_file::kVersion || mesh_file::u32_at(head, 12) != 0) {
      refuse(path.string() + ": is a mesh file of a version that this program does not know");
    }
    if (!load_index()) rebuild_index();
    for (const Entry& entry : entries_) pulses_.push_back(entry.pulse);
  }
  ~IndexedFile() { close(fd_); }
  IndexedFile(const IndexedFile&) = delete;
  IndexedFile& operator=(const IndexedFile&) = delete;

  std::optional<std::vector<uint8_t>> read(int64_t pulse) const {
    const auto entry = std::lower_bound(entries_.begin(), entries_.end(), pulse,
                                        [](const Entry& e, int64_t p) { return e.pulse < p; });
    if (entry == entries_.end() || entry->pulse != pulse) return std::nullopt;
    auto payload = read_at(fd_, entry->offset + mesh_file::kRecordSize, entry->payload_size);
    if (payload.size() != entry->payload_size || crc32(payload) != entry->payload_crc) {
      return std::nullopt;
    }
    return payload;
  }

  const std::vector<Entry>& entries() const { return entries_; }
  const std::vector<int64_t>& pulses() const { return pulses_; }
  bool index_was_rebuilt() const { return rebuilt_; }

 private:
  [[noreturn]] void refuse(const std::string& message) const {
    close(fd_);
    throw InputError(message);
  }

  /// The bytes of the index, when the footer points at them rightly.
  std::vector<uint8_t> index_bytes() const {
    using namespace mesh_file;
    if (file_size_ < kHeaderSize + kIndexHeadSize + kFooterSize) return {};
    const uint64_t footer_offset = file_size_ - kFooterSize;
    const auto footer = read_at(fd_, footer_offset, kFooterSize);
    if (footer.size() != kFooterSize || !magic_at(footer, 16, kFooterMagic)) return {};
    const uint64_t offset = u64_at(footer, 0);
    const uint32_t size = u32_at(footer, 8);
    if (offset < kHeaderSize || offset > footer_offset || size != footer_offset - offset) return {};
    auto bytes = read_at(fd_, offset, size);
    if (bytes.size() != size || crc32(bytes) != u32_at(footer, 12)) return {};
    return bytes;
  }

  bool load_index() {
    using namespace mesh_file;
    const auto bytes = index_bytes();
    if (bytes.size() < kIndexHeadSize || !magic_at(bytes, 0, kIndexMagic)) return false;
    const size_t count = u32_at(bytes, 4);
    if (bytes.size() != kIndexHeadSize + count * kEntrySize) return false;
    for (size_t at = kIndexHeadSize; at < bytes.size(); at += kEntrySize) {
      const Entry entry{.pulse = static_cast<int64_t>(u64_at(bytes, at)),
                        .offset = u64_at(bytes, at + 8),
                        .payload_size = u32_at(bytes, at + 16),
                        .payload_crc = u32_at(bytes, at + 20)};
      if (!follows(entry) || entry.offset < kHeaderSize || !inside_file(entry)) {
        entries_.clear();
        return false;
      }
      entries_.push_back(entry);
    }
    return true;
  }

  bool follows(const Entry& entry) const {
    return entry.pulse >= 0 && (entries_.empty() || entry.pulse > entries_.back().pulse);
  }
  bool inside_file(const Entry& entry) const {
    return entry.offset <= file_size_ &&
           file_size_ - entry.offset >= mesh_file::kRecordSize + uint64_t{entry.payload_size};
  }

  std::optional<Entry> record_at(uint64_t offset) const {
    const auto head = read_at(fd_, offset, mesh_file::kRecordSize);
    const auto entry = mesh_file::read_record_head(head, offset);
    return entry && inside_file(*entry) ? entry : std::nullopt;
  }

  /// The next offset from `from` at which a right record begins, or the end of the file.
  uint64_t next_record(uint64_t from) const {
    constexpr size_t kChunk = 1 << 16;
    const auto& magic = mesh_file::kRecordMagic;
    while (from + mesh_file::kRecordSize <= file_size_) {
      const auto chunk = read_at(fd_, from, kChunk);
      if (chunk.size() < magic.size()) break;
      for (auto hit = chunk.begin();; ++hit) {
        hit = std::search(hit, chunk.end(), magic.begin(), magic.end());
        if (hit == chunk.end()) break;
        const uint64_t offset = from + static_cast<uint64_t>(hit - chunk.begin());
        if (record_at(offset)) return offset;
      }
      from += chunk.size() - (magic.size() - 1);
    }
    return file_size_;
  }

  void rebuild_index() {
    rebuilt_ = true;
    uint64_t offset = mesh_file::kHeaderSize;
    while (offset < file_size_) {
      const auto entry = record_at(offset);
      if (!entry) {
        offset = next_record(offset + 1);
        continue;
      }
      if (follows(*entry)) entries_.push_back(*entry);
      offset += mesh_file::kRecordSize + entry->payload_size;
    }
  }

  int fd_;
  uint64_t file_size_ = 0;
  std::vector<Entry> entries_;
  std::vector<int64_t> pulses_;
  bool rebuilt_ = false;
};

}  // namespace

class MeshFileWriter::Impl {
 public:
  Impl(const std::filesystem::path& path, LogOpening opening) {
    if (opening == LogOpening::kGoOn) find_end(path);
    fd_ = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (fd_ < 0 || ftruncate(fd_, static_cast<off_t>(end_)) != 0 ||
        !write_all(fd_, 0, mesh_file::header())) {
      const std::string message = errno_message("cannot create mesh file " + path.string());
      if (fd_ >= 0) ::close(fd_);
      throw InputError(message);
    }
  }
  ~Impl() { close(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  bool append(int64_t pulse, std::span<const uint8_t> compact) {
    assert(!last_pulse() || pulse > *last_pulse());
    if (fd_ < 0 || compact.size() > mesh_file::kMaxPayload) return false;
    const Entry entry{.pulse = pulse,
                      .offset = end_,
                      .payload_size = static_cast<uint32_t>(compact.size()),
                      .payload_crc = crc32(compact)};
    if (!write_all(fd_, end_, mesh_file::record_head(entry)) ||
        !write_all(fd_, end_ + mesh_file::kRecordSize, compact)) {
      cut_back();
      return false;
    }
    end_ += mesh_file::kRecordSize + compact.size();
    pulses_.insert(pulse);
    payloads_.push_back({entry.payload_size, entry.payload_crc});
    return true;
  }

  bool close() {
    if (fd_ < 0) return closed_well_;
    closed_well_ = write_all(fd_, end_, mesh_file::index(entries(), end_));
    if (!closed_well_) cut_back();
    closed_well_ = fsync(fd_) == 0 && closed_well_;
    ::close(std::exchange(fd_, -1));
    return closed_well_;
  }

  size_t size() const { return found_.size() + payloads_.size(); }
  std::optional<int64_t> last_pulse() const {
    if (!payloads_.empty()) return pulses_.last();
    return found_.empty() ? std::nullopt : std::optional(found_.back().pulse);
  }

 private:
  /// All that is kept of a record until the index is written: a take may last hours.
  struct Payload {
    uint32_t size, crc;
  };

  /// Of a file that holds no mesh nothing is kept.
  void find_end(const std::filesystem::path& path) {
    try {
      found_ = IndexedFile(path).entries();
    } catch (const InputError&) {
      return;
    }
    if (found_.empty()) return;
    const Entry& last = found_.back();
    begin_ = end_ = last.offset + mesh_file::kRecordSize + last.payload_size;
  }

  /// What the index says. Our own records lie one behind the other.
  std::vector<Entry> entries() const {
    std::vector<Entry> entries = found_;
    uint64_t offset = begin_;
    auto payload = payloads_.begin();
    for (const int64_t pulse : pulses_.all()) {
      entries.push_back({pulse, offset, payload->size, payload->crc});
      offset += mesh_file::kRecordSize + payload->size;
      ++payload;
    }
    return entries;
  }

  /// What the disk took of an unfinished piece goes; if that fails too, readers pass over it.
  void cut_back() {
    if (ftruncate(fd_, static_cast<off_t>(end_)) != 0) return;
  }

  int fd_ = -1;
  std::vector<Entry> found_;                 ///< that were in the file before
  uint64_t begin_ = mesh_file::kHeaderSize;  ///< of what is appended
  uint64_t end_ = mesh_file::kHeaderSize;
  PulseSet pulses_;
  std::deque<Payload> payloads_;  ///< grows by pieces, not by doubling
  bool closed_well_ = false;
};

MeshFileWriter::MeshFileWriter(const std::filesystem::path& path, LogOpening opening)
    : impl_(std::make_unique<Impl>(path, opening)) {}
MeshFileWriter::~MeshFileWriter() = default;
MeshFileWriter::MeshFileWriter(MeshFileWriter&&) noexcept = default;
bool MeshFileWriter::append(int64_t pulse, std::span<const uint8_t> compact) {
  return impl_->append(pulse, compact);
}
size_t MeshFileWriter::size() const { return impl_->size(); }
std::optional<int64_t> MeshFileWriter::last_pulse() const { return impl_->last_pulse(); }
bool MeshFileWriter::close() { return impl_->close(); }

class MeshFileReader::Impl : public IndexedFile {
 public:
  using IndexedFile::IndexedFile;
};

MeshFileReader::MeshFileReader(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}
MeshFileReader::~MeshFileReader() = default;
MeshFileReader::MeshFileReader(MeshFileReader&&) noexcept = default;
const std::vector<int64_t>& MeshFileReader::pulses() const { return impl_->pulses(); }
bool MeshFileReader::index_was_rebuilt() const { return impl_->index_was_rebuilt(); }
std::optional<std::vector<uint8_t>> MeshFileReader::read(int64_t pulse) {
  return impl_->read(pulse);
}

}  // namespace v3d
