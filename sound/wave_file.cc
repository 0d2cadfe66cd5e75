#include "sound/wave_file.h"

#include <fmt/core.h>
#include <sndfile.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <optional>
#include <utility>

#include "base/core/error.h"

namespace v3d::sound {
namespace {

using SoundFile = std::unique_ptr<SNDFILE, int (*)(SNDFILE*)>;

/// The bytes of a sound file, as libsndfile accesses them: a file or memory. Keeps the first error.
class ByteAccess {
 public:
  explicit ByteAccess(io::File file) : file_(std::move(file)) {}
  explicit ByteAccess(std::vector<uint8_t> bytes) : bytes_(std::move(bytes)) {}

  const io::File& file() const { return *file_; }
  const std::optional<io::IoError>& error() const { return error_; }

  sf_count_t size() {
    if (!file_) return static_cast<sf_count_t>(bytes_.size());
    const auto size = file_->size();
    if (!size) keep(size.error());
    return static_cast<sf_count_t>(size.value_or(0));
  }
  sf_count_t seek(sf_count_t offset, int whence) {
    const sf_count_t base = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? at_ : size();
    return at_ = std::max<sf_count_t>(0, base + offset);
  }
  sf_count_t tell() const { return at_; }
  sf_count_t read(std::span<uint8_t> to) {
    const sf_count_t done = file_ ? read_file(to) : read_memory(to);
    at_ += done;
    return done;
  }
  sf_count_t write(std::span<const uint8_t> from) {
    if (!file_) return 0;
    if (at_ == 0) header_.assign(from.begin(), from.end());
    if (const auto done = file_->write(static_cast<uint64_t>(at_), {from}); !done) {
      keep(done.error());
      return 0;
    }
    at_ += static_cast<sf_count_t>(from.size());
    return static_cast<sf_count_t>(from.size());
  }
  /// The header of the file, as libsndfile wrote it last: it writes it at once.
  const std::vector<uint8_t>& header() const { return header_; }

 private:
  sf_count_t read_file(std::span<uint8_t> to) {
    const auto done = file_->read(static_cast<uint64_t>(at_), to);
    if (!done) keep(done.error());
    return static_cast<sf_count_t>(done.value_or(0));
  }
  sf_count_t read_memory(std::span<uint8_t> to) const {
    const sf_count_t left = static_cast<sf_count_t>(bytes_.size()) - at_;
    const sf_count_t count = std::clamp<sf_count_t>(left, 0, static_cast<sf_count_t>(to.size()));
    if (count > 0) std::memcpy(to.data(), bytes_.data() + at_, static_cast<size_t>(count));
    return count;
  }
  void keep(const io::IoError& error) {
    if (!error_) error_ = error;
  }

  std::optional<io::File> file_;
  std::vector<uint8_t> bytes_, header_;
  sf_count_t at_ = 0;
  std::optional<io::IoError> error_;
};

ByteAccess& access_of(void* user) { return *static_cast<ByteAccess*>(user); }

/// libsndfile does not change this table.
SF_VIRTUAL_IO virtual_io = {
    .get_filelen = [](void* user) { return access_of(user).size(); },
    .seek = [](sf_count_t offset, int whence,
               void* user) { return access_of(user).seek(offset, whence); },
    .read =
        [](void* to, sf_count_t count, void* user) {
          return access_of(user).read({static_cast<uint8_t*>(to), static_cast<size_t>(count)});
        },
    .write =
        [](const void* from, sf_count_t count, void* user) {
          return access_of(user).write(
              {static_cast<const uint8_t*>(from), static_cast<size_t>(count)});
        },
    .tell = [](void* user) { return access_of(user).tell(); }};

SoundFile open_virtual(ByteAccess& access, int mode, SF_INFO& info) {
  return {sf_open_virtual(&virtual_io, mode, &info, &access), sf_close};
}

/// The error of the disk, else that of libsndfile.
tl::unexpected<io::IoError> error_of(const ByteAccess& access, SNDFILE* file,
                                     std::string_view action, const std::filesystem::path& path) {
  if (access.error()) return tl::make_unexpected(*access.error());
  return io::io_error(action, path, sf_strerror(file));
}

template <size_t N>
void copy_text(const std::string& from, char (&to)[N]) {
  std::memcpy(to, from.data(), std::min(N, from.size()));
}

template <size_t N>
std::string text_of(const char (&from)[N]) {
  return {from, std::find(from, from + N, '\0')};
}

SF_BROADCAST_INFO broadcast_info(const WaveOrigin& origin) {
  SF_BROADCAST_INFO info{};
  copy_text(origin.description, info.description);
  copy_text(origin.originator, info.originator);
  copy_text(origin.date, info.origination_date);
  copy_text(origin.time, info.origination_time);
  const auto reference = static_cast<uint64_t>(origin.samples_since_midnight);
  info.time_reference_low = static_cast<uint32_t>(reference);
  info.time_reference_high = static_cast<uint32_t>(reference >> 32);
  info.version = 2;
  return info;
}

constexpr char kMetadataChunk[] = "iXML";

/// What the chunk iXML states when a recording begins.
WaveMetadata metadata_of(const WaveOrigin& origin, int rate_hz) {
  return {.rate_hz = rate_hz,
          .samples_since_midnight = origin.samples_since_midnight,
          .timecode_rate = origin.timecode_rate,
          .first_sample = origin.first_sample};
}

SF_CHUNK_INFO metadata_chunk() {
  SF_CHUNK_INFO chunk{};
  chunk.id_size = sizeof kMetadataChunk - 1;
  std::memcpy(chunk.id, kMetadataChunk, chunk.id_size);
  return chunk;
}

/// The text of the chunk iXML; empty where there is none, or a very long one.
std::string read_metadata_chunk(SNDFILE* file) {
  constexpr unsigned kMaxBytes = 64 << 10;
  SF_CHUNK_INFO chunk = metadata_chunk();
  SF_CHUNK_ITERATOR* const found = sf_get_chunk_iterator(file, &chunk);
  if (found == nullptr || sf_get_chunk_size(found, &chunk) != SF_ERR_NO_ERROR) return {};
  if (chunk.datalen > kMaxBytes) return {};
  std::string text(chunk.datalen, ' ');
  chunk.data = text.data();
  return sf_get_chunk_data(found, &chunk) == SF_ERR_NO_ERROR ? text : "";
}

uint32_t number_at(std::span<const uint8_t> bytes) {
  uint32_t number = 0;
  for (size_t i = 0; i < sizeof number; ++i) number |= uint32_t{bytes[i]} << (8 * i);
  return number;
}

/// The content of a chunk of the header; empty where there is none.
std::span<uint8_t> chunk_of(std::span<uint8_t> header, std::string_view name) {
  constexpr size_t kForm = 12, kChunkHead = 8;
  for (size_t at = kForm; at + kChunkHead <= header.size();) {
    const auto head = header.subspan(at, kChunkHead);
    const size_t size = number_at(head.subspan(4));
    const size_t begin = at + kChunkHead;
    const bool is_whole = size <= header.size() - begin;
    if (is_whole && std::equal(name.begin(), name.end(), head.begin()))
      return header.subspan(begin, size);
    at = begin + size + size % 2;
  }
  return {};
}

/// A header with another time reference and another chunk iXML. Empty where a chunk is missing.
std::vector<uint8_t> changed_header(std::vector<uint8_t> header, int64_t samples_since_midnight,
                                    const std::string& metadata) {
  constexpr size_t kReference = 256 + 32 + 32 + 10 + 8;  // after texts, date and time
  const auto bext = chunk_of(header, "bext");
  const auto ixml = chunk_of(header, kMetadataChunk);
  if (bext.size() < kReference + sizeof(int64_t) || ixml.size() != metadata.size()) return {};
  const auto reference = static_cast<uint64_t>(samples_since_midnight);
  for (size_t i = 0; i < sizeof reference; ++i) {
    bext[kReference + i] = static_cast<uint8_t>(reference >> (8 * i));
  }
  std::copy(metadata.begin(), metadata.end(), ixml.begin());
  return header;
}

WaveOrigin read_origin(SNDFILE* file) {
  SF_BROADCAST_INFO info{};
  if (sf_command(file, SFC_GET_BROADCAST_INFO, &info, sizeof info) != SF_TRUE) return {};
  const uint64_t reference =
      static_cast<uint64_t>(info.time_reference_high) << 32 | info.time_reference_low;
  const WaveMetadata metadata = read_metadata(read_metadata_chunk(file));
  return {.description = text_of(info.description),
          .originator = text_of(info.originator),
          .date = text_of(info.origination_date),
          .time = text_of(info.origination_time),
          .samples_since_midnight = static_cast<int64_t>(reference),
          .first_sample = metadata.first_sample,
          .timecode_rate = metadata.timecode_rate};
}

}  // namespace

WaveOrigin wave_origin(RealtimeInstant first_sample, int rate_hz, std::string description,
                       std::string originator) {
  const int64_t ns = to_ns(first_sample);
  const auto seconds = static_cast<time_t>(ns / 1'000'000'000);
  tm local{};
  localtime_r(&seconds, &local);
  const int64_t since_midnight = (local.tm_hour * 60LL + local.tm_min) * 60 + local.tm_sec;
  return {.description = std::move(description),
          .originator = std::move(originator),
          .date = fmt::format("{:04}-{:02}-{:02}", local.tm_year + 1900, local.tm_mon + 1,
                              local.tm_mday),
          .time = fmt::format("{:02}:{:02}:{:02}", local.tm_hour, local.tm_min, local.tm_sec),
          .samples_since_midnight =
              since_midnight * rate_hz + ns % 1'000'000'000 * rate_hz / 1'000'000'000,
          .first_sample = first_sample};
}

std::optional<RealtimeInstant> first_sample_time(const WaveOrigin& origin, int rate_hz) {
  if (origin.first_sample) return origin.first_sample;
  if (origin.timecode_rate) return std::nullopt;  // the reference is no time of day
  tm local{};
  const char* const end = strptime(origin.date.c_str(), "%Y-%m-%d", &local);
  if (end == nullptr || *end != '\0') return std::nullopt;
  const int64_t seconds = origin.samples_since_midnight / rate_hz;
  if (seconds < 0 || seconds >= 24 * 3600) return std::nullopt;
  local.tm_hour = static_cast<int>(seconds / 3600);
  local.tm_min = static_cast<int>(seconds / 60 % 60);
  local.tm_sec = static_cast<int>(seconds % 60);
  local.tm_isdst = -1;
  const time_t whole = mktime(&local);
  if (whole == -1) return std::nullopt;
  const int64_t fraction = origin.samples_since_midnight % rate_hz;
  return from_ns<Realtime>(int64_t{whole} * 1'000'000'000 + fraction * 1'000'000'000 / rate_hz);
}

// --- writer -------------------------------------------------------------------------------------

struct WaveWriter::Impl {
  explicit Impl(io::File opened) : access(std::move(opened)) {}

  ByteAccess access;
  SoundFile file{nullptr, sf_close};
  int rate_hz = 0;
  int channels = 0;
  std::optional<RealtimeInstant> first_sample;
  int64_t samples = 0;
  io::Status status;
};

WaveWriter::WaveWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WaveWriter::WaveWriter(WaveWriter&&) noexcept = default;
WaveWriter& WaveWriter::operator=(WaveWriter&&) noexcept = default;
WaveWriter::~WaveWriter() = default;

io::Result<WaveWriter> WaveWriter::create(const std::filesystem::path& path,
                                          const WaveFormat& format, const WaveOrigin& origin) {
  V3D_CHECK(format.rate_hz >= kMinRateHz && format.rate_hz <= kMaxRateHz);
  V3D_CHECK(format.channels >= 1 && format.channels <= kMaxChannels);
  auto opened = io::File::open(path, io::OpenMode::kCreate);
  if (!opened) return tl::make_unexpected(opened.error());
  auto impl = std::make_unique<Impl>(*std::move(opened));
  SF_INFO info{};
  info.samplerate = format.rate_hz;
  info.channels = impl->channels = format.channels;
  impl->rate_hz = format.rate_hz;
  impl->first_sample = origin.first_sample;
  info.format = SF_FORMAT_RF64 | SF_FORMAT_PCM_24;
  impl->file = open_virtual(impl->access, SFM_WRITE, info);
  if (!impl->file) return error_of(impl->access, nullptr, "create", path);
  SNDFILE* const file = impl->file.get();
  SF_BROADCAST_INFO bext = broadcast_info(origin);
  sf_command(file, SFC_RF64_AUTO_DOWNGRADE, nullptr, SF_TRUE);
  sf_command(file, SFC_SET_BROADCAST_INFO, &bext, sizeof bext);
  std::string metadata = write_metadata(metadata_of(origin, format.rate_hz));
  SF_CHUNK_INFO chunk = metadata_chunk();
  chunk.data = metadata.data();
  chunk.datalen = static_cast<unsigned>(metadata.size());
  sf_set_chunk(file, &chunk);
  sf_command(file, SFC_SET_UPDATE_HEADER_AUTO, nullptr, SF_TRUE);
  sf_command(file, SFC_UPDATE_HEADER_NOW, nullptr, 0);
  if (impl->access.error()) return tl::make_unexpected(*impl->access.error());
  return WaveWriter(std::move(impl));
}

io::Status WaveWriter::write(std::span<const int32_t> values) {
  V3D_CHECK(values.size() % static_cast<size_t>(impl_->channels) == 0);
  if (!impl_->status || values.empty()) return impl_->status;
  const auto count = static_cast<sf_count_t>(values.size());
  const sf_count_t done = sf_write_int(impl_->file.get(), values.data(), count);
  impl_->samples += done / impl_->channels;
  if (done != count || impl_->access.error()) {
    impl_->status = error_of(impl_->access, impl_->file.get(), "write", file().path());
  }
  return impl_->status;
}

io::Status WaveWriter::finish(const std::optional<WaveTimecode>& timecode) {
  impl_->file.reset();  // writes the header for the last time
  if (!impl_->status || !timecode) return impl_->status;
  if (impl_->access.error()) return tl::make_unexpected(*impl_->access.error());
  const std::string metadata =
      write_metadata({.rate_hz = impl_->rate_hz,
                      .samples_since_midnight = timecode->samples_since_midnight,
                      .timecode_rate = timecode->rate,
                      .first_sample = impl_->first_sample});
  const std::vector<uint8_t> header =
      changed_header(impl_->access.header(), timecode->samples_since_midnight, metadata);
  if (header.empty()) return io::io_error("write", file().path(), "its header has no timecode");
  impl_->access.seek(0, SEEK_SET);
  impl_->access.write(header);  // within a page of the file: a kill leaves the old one or the new
  if (impl_->access.error()) return tl::make_unexpected(*impl_->access.error());
  return {};
}

int64_t WaveWriter::samples() const { return impl_->samples; }
const io::File& WaveWriter::file() const { return impl_->access.file(); }

// --- reader -------------------------------------------------------------------------------------

struct WaveReader::Impl {
  template <class Source>
  Impl(Source source, std::filesystem::path name)
      : access(std::move(source)), path(std::move(name)) {}

  ByteAccess access;
  std::filesystem::path path;
  SoundFile file{nullptr, sf_close};
  WaveFormat format;
  WaveOrigin origin;
  int64_t samples = 0;

  io::Status open();
  tl::unexpected<io::IoError> reject(const std::string& why) const {
    return io::io_error("read", path, why + "; expected a WAV or RF64 file of PCM");
  }
};

io::Status WaveReader::Impl::open() {
  std::array<uint8_t, 12> head{};
  const auto got = static_cast<size_t>(access.read(head));
  access.seek(0, SEEK_SET);
  const std::string_view text(reinterpret_cast<const char*>(head.data()), got);
  const bool is_wave =
      (text.starts_with("RIFF") || text.starts_with("RF64")) && text.ends_with("WAVE");
  if (access.error()) return tl::make_unexpected(*access.error());
  if (!is_wave) return reject("it is not a sound file");
  SF_INFO info{};
  file = open_virtual(access, SFM_READ, info);
  if (!file) return reject(sf_strerror(nullptr));
  const int coding = info.format & SF_FORMAT_SUBMASK;
  if (coding != SF_FORMAT_PCM_16 && coding != SF_FORMAT_PCM_24 && coding != SF_FORMAT_PCM_32) {
    return reject("its coding is not supported");
  }
  if (info.samplerate < kMinRateHz || info.samplerate > kMaxRateHz) {
    return reject(fmt::format("its rate is {} Hz", info.samplerate));
  }
  if (info.channels < 1 || info.channels > kMaxChannels) {
    return reject(fmt::format("it has {} channels", info.channels));
  }
  format = {.rate_hz = info.samplerate, .channels = info.channels};
  samples = info.frames;
  origin = read_origin(file.get());
  return {};
}

WaveReader::WaveReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WaveReader::WaveReader(WaveReader&&) noexcept = default;
WaveReader& WaveReader::operator=(WaveReader&&) noexcept = default;
WaveReader::~WaveReader() = default;

io::Result<WaveReader> WaveReader::open(const std::filesystem::path& path) {
  auto opened = io::File::open(path, io::OpenMode::kRead);
  if (!opened) return tl::make_unexpected(opened.error());
  auto impl = std::make_unique<Impl>(*std::move(opened), path);
  if (auto done = impl->open(); !done) return tl::make_unexpected(done.error());
  return WaveReader(std::move(impl));
}

io::Result<WaveReader> WaveReader::parse(std::vector<uint8_t> bytes,
                                         const std::filesystem::path& name) {
  auto impl = std::make_unique<Impl>(std::move(bytes), name);
  if (auto done = impl->open(); !done) return tl::make_unexpected(done.error());
  return WaveReader(std::move(impl));
}

const WaveFormat& WaveReader::format() const { return impl_->format; }
int64_t WaveReader::samples() const { return impl_->samples; }
const WaveOrigin& WaveReader::origin() const { return impl_->origin; }

io::Result<std::vector<int32_t>> WaveReader::read(int64_t first, int64_t count) {
  const int64_t from = std::clamp<int64_t>(first, 0, impl_->samples);
  const int64_t left = std::clamp<int64_t>(count, 0, impl_->samples - from);
  std::vector<int32_t> values(static_cast<size_t>(left * impl_->format.channels));
  if (left == 0) return values;
  SNDFILE* const file = impl_->file.get();
  if (sf_seek(file, from, SEEK_SET) != from) {
    return error_of(impl_->access, file, "read", impl_->path);
  }
  const sf_count_t done = sf_readf_int(file, values.data(), left);
  if (impl_->access.error()) return tl::make_unexpected(*impl_->access.error());
  values.resize(static_cast<size_t>(std::max<sf_count_t>(0, done) * impl_->format.channels));
  return values;
}

}  // namespace v3d::sound
