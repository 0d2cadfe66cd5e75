#include "take/logs/mesh_file.h"

#include <algorithm>
#include <deque>
#include <utility>

#include "base/core/error.h"
#include "base/io/disk_error.h"
#include "base/io/file.h"
#include "take/ledger/ledger.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file_layout.h"

namespace v3d::take {
namespace {

using mesh_file::Entry;

io::File open_mesh_file(const std::filesystem::path& path) {
  return io::value_or_throw(io::File::open(path, io::OpenMode::kReadWithinFolder));
}

/// A mesh file and the index of its records.
class IndexedFile {
 public:
  /// Throws InputError when the file is not a mesh file or its index cannot be read.
  explicit IndexedFile(const std::filesystem::path& path, const ReadProgress& progress = {})
      : file_(open_mesh_file(path)), file_size_(io::value_or_throw(file_.size())) {
    const auto head = read_at(0, mesh_file::kHeaderSize);
    if (head.size() < mesh_file::kHeaderSize ||
        !mesh_file::magic_at(head, 0, mesh_file::kFileMagic)) {
      throw InputError(path.string() + ": is not a mesh file (mesh.v3d)");
    }
    if (mesh_file::u32_at(head, 8) != mesh_file::kVersion || mesh_file::u32_at(head, 12) != 0) {
      throw InputError(path.string() +
                       ": is a mesh file of a version that this program does not support");
    }
    if (!load_index()) rebuild_index(progress);
    for (const Entry& entry : entries_) pulses_.push_back(entry.pulse);
  }
  io::Result<std::optional<std::vector<uint8_t>>> read(int64_t pulse) const {
    if (!entry_of(pulse)) return std::nullopt;
    auto record = read_record(pulse);
    if (!record) return tl::make_unexpected(record.error());
    if (!record->is_intact() || mesh_file::is_of_other_pulse(record->compact, pulse)) {
      return std::nullopt;
    }
    return std::move(record->compact);
  }
  io::Result<MeshRecord> read_record(int64_t pulse) const {
    const Entry* const entry = entry_of(pulse);
    V3D_CHECK(entry);
    MeshRecord record{.compact = std::vector<uint8_t>(entry->payload_size),
                      .checksum = entry->payload_crc};
    const auto read = file_.read_whole(entry->offset + mesh_file::kRecordSize, record.compact);
    if (!read) return tl::make_unexpected(read.error());
    return record;
  }

  const std::vector<Entry>& entries() const { return entries_; }
  const std::vector<int64_t>& pulses() const { return pulses_; }
  bool index_was_rebuilt() const { return rebuilt_; }
  uint64_t file_size() const { return file_size_; }

 private:
  /// Null when the file has no record of `pulse`.
  const Entry* entry_of(int64_t pulse) const {
    const auto entry = std::ranges::lower_bound(entries_, pulse, {}, &Entry::pulse);
    return entry == entries_.end() || entry->pulse != pulse ? nullptr : &*entry;
  }

  /// Reads `size` bytes; fewer only at the end of the file.
  std::vector<uint8_t> read_at(uint64_t offset, size_t size) const {
    std::vector<uint8_t> bytes(size);
    bytes.resize(io::value_or_throw(file_.read(offset, bytes)));
    return bytes;
  }

  /// The bytes of the index; empty when the footer does not point to a valid index.
  std::vector<uint8_t> index_bytes() const {
    using namespace mesh_file;
    if (file_size_ < kHeaderSize + kIndexHeadSize + kFooterSize) return {};
    const uint64_t footer_offset = file_size_ - kFooterSize;
    const auto footer = read_at(footer_offset, kFooterSize);
    if (footer.size() != kFooterSize || !magic_at(footer, 16, kFooterMagic)) return {};
    const uint64_t offset = u64_at(footer, 0);
    const uint32_t size = u32_at(footer, 8);
    if (offset < kHeaderSize || offset > footer_offset || size != footer_offset - offset) return {};
    if (size > kMaxIndex) return {};
    auto bytes = read_at(offset, size);
    if (bytes.size() != size || codec::crc32(bytes) != u32_at(footer, 12)) return {};
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
  /// True when the record lies inside the file. The claimed length has a limit of its own, because
  /// a sparse file can have any length.
  bool inside_file(const Entry& entry) const {
    return entry.payload_size <= mesh_file::kMaxPayload && entry.offset <= file_size_ &&
           file_size_ - entry.offset >= mesh_file::kRecordSize + uint64_t{entry.payload_size};
  }

  std::optional<Entry> record_at(uint64_t offset) const {
    const auto head = read_at(offset, mesh_file::kRecordSize);
    const auto entry = mesh_file::read_record_head(head, offset);
    return entry && inside_file(*entry) ? entry : std::nullopt;
  }

  /// True when the record is complete: another record, the index or the end of the file follows it,
  /// or its checksum is correct. Otherwise a killed program left an unfinished record, and later
  /// records lie where its payload would be.
  bool is_whole(const Entry& entry, const ReadProgress& progress) {
    const uint64_t end = entry.offset + mesh_file::kRecordSize + entry.payload_size;
    if (end == file_size_ || record_at(end)) return true;
    const auto magic = read_at(end, mesh_file::kIndexMagic.size());
    if (mesh_file::magic_at(magic, 0, mesh_file::kIndexMagic)) return true;
    return has_right_checksum(entry, progress);
  }

  /// True when the payload matches its checksum. Also false after payloads of more than four times
  /// the file's length were read: only overlapping records need that, and each may claim 256 MiB.
  bool has_right_checksum(const Entry& entry, const ReadProgress& progress) {
    constexpr uint32_t kChunk = 1 << 20;
    if (checksummed_ > 4 * file_size_) return false;
    checksummed_ += entry.payload_size;
    uint32_t crc = 0;
    for (uint32_t done = 0; done < entry.payload_size;) {
      const uint32_t size = std::min(kChunk, entry.payload_size - done);
      const auto bytes = read_at(entry.offset + mesh_file::kRecordSize + done, size);
      if (bytes.size() < size) return false;
      if (progress) progress();
      crc = codec::crc32(bytes, crc);
      done += size;
    }
    return crc == entry.payload_crc;
  }

  /// The next offset from `from` on at which a valid record starts; the end of the file if there is
  /// none.
  uint64_t next_record(uint64_t from, const ReadProgress& progress) const {
    constexpr size_t kChunk = 1 << 16;
    const auto& magic = mesh_file::kRecordMagic;
    while ((from = next_data(file_, from)) + mesh_file::kRecordSize <= file_size_) {
      const auto chunk = read_at(from, kChunk);
      if (chunk.size() < magic.size()) break;
      if (progress) progress();
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

  void rebuild_index(const ReadProgress& progress) {
    rebuilt_ = true;
    uint64_t offset = mesh_file::kHeaderSize;
    while (offset < file_size_) {
      if (progress) progress();
      const auto entry = record_at(offset);
      if (!entry || !is_whole(*entry, progress)) {
        offset = next_record(offset + 1, progress);
        continue;
      }
      if (follows(*entry)) entries_.push_back(*entry);
      offset += mesh_file::kRecordSize + entry->payload_size;
    }
  }

  io::File file_;
  uint64_t file_size_ = 0;
  uint64_t checksummed_ = 0;  ///< payload bytes that has_right_checksum() has read
  std::vector<Entry> entries_;
  std::vector<int64_t> pulses_;
  bool rebuilt_ = false;
};

}  // namespace

bool MeshRecord::is_intact() const { return codec::crc32(compact) == checksum; }

class MeshFileWriter::Impl {
 public:
  Impl(const std::filesystem::path& path, LogOpening opening, const ReadProgress& progress)
      : path_(path), file_(open(opening, progress)) {
    sync_ = std::make_unique<PeriodicSync>(*file_, kSyncEvery);
    if (begin_ > 0) return;
    begin_ = end_ = mesh_file::kHeaderSize;
    io::throw_if_failed(file_->write(0, {mesh_file::header()}));
    // Without its header, the file cannot be continued after a power cut; without its name in the
    // folder, it is lost.
    io::throw_if_failed(sync_->sync());
    io::throw_if_failed(io::sync_folder(path.parent_path()));
  }
  ~Impl() { static_cast<void>(close()); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  io::Status append(int64_t pulse, std::span<const uint8_t> compact, uint32_t checksum) {
    V3D_CHECK(!last_pulse() || pulse > *last_pulse());
    if (!file_) return io::io_error("write", path_, "the file is closed", EBADF);
    if (compact.size() > mesh_file::kMaxPayload) {
      return io::io_error("write", path_, "the mesh is larger than 256 MiB", EFBIG);
    }
    const Entry entry{.pulse = pulse,
                      .offset = end_,
                      .payload_size = static_cast<uint32_t>(compact.size()),
                      .payload_crc = checksum};
    if (has_new_loss()) return sync_error_;
    // After a failure, the next record overwrites the written part of this one.
    auto written = file_->write(end_, {mesh_file::record_head(entry), compact});
    if (!written) return written;
    sync_->mark_dirty();
    end_ += mesh_file::kRecordSize + compact.size();
    pulses_.insert(pulse);
    payloads_.push_back({entry.payload_size, entry.payload_crc});
    return written;
  }

  io::Status sync() {
    const io::Status synced = sync_->sync();
    if (sync_error_) sync_error_ = synced;
    return sync_error_;
  }

  io::Status close() {
    if (!file_) return closed_;
    // The index is at the end of the file, also after the bytes of a record that failed.
    const auto size = file_->size();
    const uint64_t offset = std::max(end_, size.value_or(end_));
    closed_ = file_->write(offset, {mesh_file::index(entries(), offset)});
    if (const auto synced = sync(); closed_) closed_ = synced;
    sync_.reset();
    file_.reset();
    return closed_;
  }

  size_t size() const { return existing_.size() + payloads_.size(); }
  std::optional<int64_t> last_pulse() const {
    if (!payloads_.empty()) return pulses_.last();
    return existing_.empty() ? std::nullopt : std::optional(existing_.back().pulse);
  }

 private:
  /// A power cut loses at most the meshes of this period.
  static constexpr Duration kSyncEvery = std::chrono::seconds(1);

  /// True once after the disk lost meshes that it had accepted.
  bool has_new_loss() {
    if (sync_error_) sync_error_ = sync_->pop_error();
    return !sync_error_ && !std::exchange(loss_is_reported_, true);
  }

  /// The part of a record that is kept in memory until the index is written, because a take may
  /// last hours.
  struct Payload {
    uint32_t size, crc;
  };

  static io::Result<io::File> create(const std::filesystem::path& path) {
    return io::File::open(path, io::OpenMode::kCreate);
  }

  io::File open(LogOpening opening, const ReadProgress& progress) {
    auto file =
        opening == LogOpening::kContinue ? open_to_continue(path_, progress) : create(path_);
    if (!file) io::throw_creation_error(file.error());
    return *std::move(file);
  }

  /// Opens the file for appending after its last byte. An index of an earlier close, or the bytes
  /// of an unfinished record, remain, and readers skip them. A file shorter than its header is
  /// written from the start.
  io::Result<io::File> open_to_continue(const std::filesystem::path& path,
                                        const ReadProgress& progress) {
    auto file = io::File::open(path, io::OpenMode::kWriteExisting);
    if (!file && file.error().code == ENOENT) return create(path);
    if (!file) return file;
    const auto size = file->size();
    if (!size) return tl::make_unexpected(size.error());
    if (*size < mesh_file::kHeaderSize) return file;
    const IndexedFile found(path, progress);
    existing_ = found.entries();
    begin_ = end_ = found.file_size();
    return file;
  }

  /// All entries of the index: the existing ones, then those of this writer, whose records are
  /// contiguous.
  std::vector<Entry> entries() const {
    std::vector<Entry> entries = existing_;
    uint64_t offset = begin_;
    auto payload = payloads_.begin();
    for (const int64_t pulse : pulses_.all()) {
      entries.push_back({pulse, offset, payload->size, payload->crc});
      offset += mesh_file::kRecordSize + payload->size;
      ++payload;
    }
    return entries;
  }

  std::filesystem::path path_;
  std::vector<Entry> existing_;  ///< entries that existed when the file was opened
  uint64_t begin_ = 0;           ///< start of the appended records
  uint64_t end_ = 0;
  PulseSet pulses_;
  std::deque<Payload> payloads_;        ///< a deque, because it grows without copying
  std::optional<io::File> file_;        ///< empty when closed; declared after the members that
                                        ///< open_to_continue() sets
  std::unique_ptr<PeriodicSync> sync_;  ///< null when closed
  io::Status sync_error_;               ///< the first error of a sync
  bool loss_is_reported_ = false;       ///< by append()
  io::Status closed_;
};

MeshFileWriter::MeshFileWriter(const std::filesystem::path& path, LogOpening opening,
                               const ReadProgress& progress)
    : impl_(std::make_unique<Impl>(path, opening, progress)) {}
MeshFileWriter::~MeshFileWriter() = default;
MeshFileWriter::MeshFileWriter(MeshFileWriter&&) noexcept = default;
io::Status MeshFileWriter::append(int64_t pulse, std::span<const uint8_t> compact) {
  return impl_->append(pulse, compact, codec::crc32(compact));
}
io::Status MeshFileWriter::append(int64_t pulse, const MeshRecord& record) {
  return impl_->append(pulse, record.compact, record.checksum);
}
size_t MeshFileWriter::size() const { return impl_->size(); }
std::optional<int64_t> MeshFileWriter::last_pulse() const { return impl_->last_pulse(); }
io::Status MeshFileWriter::sync() { return impl_->sync(); }
io::Status MeshFileWriter::close() { return impl_->close(); }

class MeshFileReader::Impl : public IndexedFile {
 public:
  using IndexedFile::IndexedFile;
};

MeshFileReader::MeshFileReader(const std::filesystem::path& path, const ReadProgress& progress)
    : impl_(std::make_unique<Impl>(path, progress)) {}
MeshFileReader::~MeshFileReader() = default;
MeshFileReader::MeshFileReader(MeshFileReader&&) noexcept = default;
const std::vector<int64_t>& MeshFileReader::pulses() const { return impl_->pulses(); }
bool MeshFileReader::index_was_rebuilt() const { return impl_->index_was_rebuilt(); }
io::Result<std::optional<std::vector<uint8_t>>> MeshFileReader::read(int64_t pulse) {
  return impl_->read(pulse);
}
io::Result<MeshRecord> MeshFileReader::read_record(int64_t pulse) {
  return impl_->read_record(pulse);
}

}  // namespace v3d::take
