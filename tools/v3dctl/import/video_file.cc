#include <fmt/core.h>

#include "v3dctl/import/media.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "base/core/error.h"
#include "base/image/image.h"
#include "base/io/file.h"

namespace v3d::ctl {
namespace {

struct Release {
  void operator()(AVFormatContext* format) const { avformat_close_input(&format); }
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};
template <class T>
using Owned = std::unique_ptr<T, Release>;

/// Throws where the library has no memory.
template <class T>
Owned<T> own(T* object) {
  if (object == nullptr) throw std::bad_alloc();
  return Owned<T>(object);
}

}  // namespace

struct VideoFile::Impl {
  explicit Impl(std::filesystem::path file) : path(std::move(file)) {
    av_log_set_level(AV_LOG_QUIET);  // errors are reported by exceptions
    io::value_or_throw(io::File::open(path, io::OpenMode::kRead));
    open_file();
    open_decoder();
  }

  [[noreturn]] void fail() const {
    throw InputError(path.string() + ": no readable video: damaged or of an unknown kind");
  }

  /// Allows local files only, because a playlist may refer to others.
  void open_file() {
    AVFormatContext* opened = nullptr;
    AVDictionary* options = nullptr;
    av_dict_set(&options, "protocol_whitelist", "file", 0);
    const std::string url = "file:" + path.string();
    const int failed = avformat_open_input(&opened, url.c_str(), nullptr, &options);
    av_dict_free(&options);
    if (failed < 0) fail();
    format.reset(opened);
    if (avformat_find_stream_info(format.get(), nullptr) < 0) fail();
  }

  void open_decoder() {
    const AVCodec* decoder = nullptr;
    const int index = av_find_best_stream(format.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (index < 0) fail();
    stream = format->streams[index];
    codec = own(avcodec_alloc_context3(decoder));
    codec->thread_count = 0;  // as many as there are processors
    codec->max_pixels = int64_t{kMaxImageSide} * kMaxImageSide;
    if (avcodec_parameters_to_context(codec.get(), stream->codecpar) < 0) fail();
    codec->pkt_timebase = stream->time_base;
    if (avcodec_open2(codec.get(), decoder, nullptr) < 0) fail();
  }

  [[noreturn]] void refuse_damage(int error) const {
    std::array<char, AV_ERROR_MAX_STRING_SIZE> cause{};
    av_strerror(error, cause.data(), cause.size());
    const std::string place = fmt::format("near frame {}, {:.3f} s", count, next_s);
    throw InputError(path.string() + ": cannot be decoded " + place + ": " + cause.data() +
                     "; expected a video without damage");
  }

  /// A partial packet, as at the end of a truncated file, has no complete frame.
  void send_packet() {
    const bool partial = (packet->flags & AV_PKT_FLAG_CORRUPT) != 0;
    const int result =
        partial ? AVERROR_INVALIDDATA : avcodec_send_packet(codec.get(), packet.get());
    if (result < 0) refuse_damage(result);
  }

  /// Sends the next packet of the stream to the decoder, or after the last one the request to
  /// return its delayed frames. Returns false if that request was sent before.
  bool feed() {
    if (drained) return false;
    for (;;) {
      const int result = av_read_frame(format.get(), packet.get());
      if (result == AVERROR_EOF) break;
      if (result < 0) refuse_damage(result);
      const bool is_video = packet->stream_index == stream->index;
      if (is_video) send_packet();
      av_packet_unref(packet.get());
      if (is_video) return true;
    }
    drained = true;
    avcodec_send_packet(codec.get(), nullptr);
    return true;
  }

  /// Rejects a frame with parts that the decoder has concealed.
  void check_whole() const {
    const bool damaged =
        frame->decode_error_flags != 0 || (frame->flags & AV_FRAME_FLAG_CORRUPT) != 0;
    if (damaged) refuse_damage(AVERROR_INVALIDDATA);
  }

  void check_size() {
    const ImageSize here = {frame->width, frame->height};
    if (count == 0) size = here;
    if (here == size) return;
    throw InputError(path.string() + " frame " + std::to_string(count) + ": is " +
                     format_size(here) + ", but the frames before are " + format_size(size) +
                     "; expected one size in the whole video");
  }

  /// Decodes the next frame into `frame`; returns false after the last.
  bool decode() {
    for (;;) {
      const int result = avcodec_receive_frame(codec.get(), frame.get());
      if (result >= 0) break;
      if (result != AVERROR(EAGAIN) && result != AVERROR_EOF) refuse_damage(result);
      if (!feed()) return false;
    }
    check_whole();
    check_size();
    if (has_constant_rate) check_interval();
    ++count;
    update_time();
    return true;
  }

  /// Throws InputError where the time since the frame before differs from that between earlier
  /// frames by more than half of the shorter one. Containers round times, in Matroska to
  /// milliseconds. Frames without a time of their own are not checked: the times that a decoder
  /// derives for frames of an AVI file may skip a period although no frame is missing.
  void check_interval() {
    const int64_t before = std::exchange(last_time, frame->pts);
    if (before == AV_NOPTS_VALUE || frame->pts == AV_NOPTS_VALUE) return;
    const double now = static_cast<double>(frame->pts) - static_cast<double>(before);
    if (!interval) interval = now;
    if (2 * std::abs(now - *interval) <= std::min(now, *interval)) return;
    const double tick_s = av_q2d(stream->time_base);
    throw InputError(fmt::format(
        "{} frame {}: is {:.3f} s after the frame before, but earlier frames are {:.3f} s apart: "
        "frames are missing, or the rate varies; expected a video with a constant rate",
        path.string(), count, now * tick_s, *interval * tick_s));
  }

  void update_time() {
    const double period_s = rate_hz() > 0 ? 1 / rate_hz() : 0;
    const bool known = frame->best_effort_timestamp != AV_NOPTS_VALUE;
    const double at_s =
        known ? static_cast<double>(frame->best_effort_timestamp) * av_q2d(stream->time_base)
              : next_s;
    next_s = at_s + period_s;
  }

  /// 0 if the file has none.
  double rate_hz() const {
    const double rate = av_q2d(av_guess_frame_rate(format.get(), stream, nullptr));
    return std::isfinite(rate) && rate > 0 ? rate : 0;
  }

  /// Converts by the matrix and the range that the frame states. Without it, libswscale uses those
  /// of BT.601 for every video, and HD videos get wrong colours. A frame that does not state them
  /// has the matrix of BT.601, as in ffmpeg(1), and the range of its pixel format.
  void use_colour_space() {
    int* table = nullptr;
    int* to_table = nullptr;
    int is_full = 0, to_full = 0, brightness = 0, contrast = 0, saturation = 0;
    if (sws_getColorspaceDetails(scaler.get(), &table, &is_full, &to_table, &to_full, &brightness,
                                 &contrast, &saturation) < 0) {
      return;
    }
    const bool has_matrix = frame->colorspace != AVCOL_SPC_UNSPECIFIED;
    const int* const matrix =
        sws_getCoefficients(has_matrix ? static_cast<int>(frame->colorspace) : SWS_CS_DEFAULT);
    if (frame->color_range != AVCOL_RANGE_UNSPECIFIED) {
      is_full = frame->color_range == AVCOL_RANGE_JPEG ? 1 : 0;
    }
    sws_setColorspaceDetails(scaler.get(), matrix, is_full, to_table, to_full, brightness, contrast,
                             saturation);
  }

  Image picture() {
    rgb->width = size.width, rgb->height = size.height, rgb->format = AV_PIX_FMT_RGB24;
    if (rgb->data[0] == nullptr && av_frame_get_buffer(rgb.get(), 0) < 0) throw std::bad_alloc();
    scaler.reset(sws_getCachedContext(
        scaler.release(), size.width, size.height, static_cast<AVPixelFormat>(frame->format),
        size.width, size.height, AV_PIX_FMT_RGB24, SWS_BICUBIC, nullptr, nullptr, nullptr));
    if (!scaler) fail();
    use_colour_space();
    sws_scale(scaler.get(), frame->data, frame->linesize, 0, size.height, rgb->data, rgb->linesize);
    Image image(size, PixelFormat::kRGB8);
    for (int y = 0; y < size.height; ++y) {
      std::memcpy(image.row(y), rgb->data[0] + int64_t{y} * rgb->linesize[0],
                  3 * static_cast<size_t>(size.width));
    }
    return image;
  }

  const std::filesystem::path path;
  Owned<AVFormatContext> format;
  AVStream* stream = nullptr;  ///< of `format`
  Owned<AVCodecContext> codec;
  Owned<AVPacket> packet = own(av_packet_alloc());
  Owned<AVFrame> frame = own(av_frame_alloc());
  Owned<AVFrame> rgb = own(av_frame_alloc());
  Owned<SwsContext> scaler;
  ImageSize size;     ///< of the first frame
  int64_t count = 0;  ///< frames decoded
  double next_s = 0;  ///< time of the next frame, seconds
  bool has_constant_rate = false;
  int64_t last_time = AV_NOPTS_VALUE;  ///< that the file states for the frame before, ticks
  std::optional<double> interval;      ///< of the first frames with times, ticks
  bool drained = false;
};

VideoFile::VideoFile(const std::filesystem::path& path) : impl_(std::make_unique<Impl>(path)) {}
VideoFile::~VideoFile() = default;
VideoFile::VideoFile(VideoFile&&) noexcept = default;

double VideoFile::rate_hz() const { return impl_->rate_hz(); }

int64_t VideoFile::announced_frames() const {
  if (impl_->stream->nb_frames > 0) return impl_->stream->nb_frames;
  const double seconds = static_cast<double>(impl_->format->duration) / AV_TIME_BASE;
  const double frames = std::floor(seconds * rate_hz() + 0.5);
  return frames > 0 && frames < 1e12 ? static_cast<int64_t>(frames) : 0;
}

void VideoFile::require_constant_rate() { impl_->has_constant_rate = true; }

std::optional<Image> VideoFile::next() {
  if (!impl_->decode()) return std::nullopt;
  return impl_->picture();
}

bool VideoFile::skip() { return impl_->decode(); }

}  // namespace v3d::ctl
