#include "v3dctl/video_file.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

#include <cmath>
#include <cstring>
#include <new>
#include <string>

#include "base/error.h"
#include "base/image_size.h"
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
    av_log_set_level(AV_LOG_QUIET);  // what matters is in our message
    io::value_or_throw(io::File::open(path, io::OpenMode::kRead));
    open_file();
    open_decoder();
  }

  [[noreturn]] void refuse() const {
    throw InputError(path.string() + ": no readable video: damaged or of an unknown kind");
  }

  /// Only local files: a playlist may name others.
  void open_file() {
    AVFormatContext* opened = nullptr;
    AVDictionary* options = nullptr;
    av_dict_set(&options, "protocol_whitelist", "file", 0);
    const std::string url = "file:" + path.string();
    const int failed = avformat_open_input(&opened, url.c_str(), nullptr, &options);
    av_dict_free(&options);
    if (failed < 0) refuse();
    format.reset(opened);
    if (avformat_find_stream_info(format.get(), nullptr) < 0) refuse();
  }

  void open_decoder() {
    const AVCodec* decoder = nullptr;
    const int index = av_find_best_stream(format.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (index < 0) refuse();
    stream = format->streams[index];
    codec = own(avcodec_alloc_context3(decoder));
    codec->thread_count = 0;  // as many as there are processors
    codec->max_pixels = int64_t{kMaxImageSide} * kMaxImageSide;
    if (avcodec_parameters_to_context(codec.get(), stream->codecpar) < 0) refuse();
    codec->pkt_timebase = stream->time_base;
    if (avcodec_open2(codec.get(), decoder, nullptr) < 0) refuse();
  }

  /// The next packet of the stream goes to the decoder; at the end of the file, the word that there
  /// is no more. False when that was said before.
  bool feed() {
    if (drained) return false;
    while (av_read_frame(format.get(), packet.get()) >= 0) {
      const bool ours = packet->stream_index == stream->index;
      if (ours) avcodec_send_packet(codec.get(), packet.get());
      av_packet_unref(packet.get());
      if (ours) return true;
    }
    drained = true;
    avcodec_send_packet(codec.get(), nullptr);
    return true;
  }

  /// Decodes the next frame into `frame`; false behind the last.
  bool decode() {
    while (avcodec_receive_frame(codec.get(), frame.get()) < 0) {
      if (!feed()) return false;
    }
    const ImageSize here = {frame->width, frame->height};
    if (count == 0) size = here;
    if (here != size) {
      throw InputError(path.string() + " frame " + std::to_string(count) + ": is " +
                       format_size(here) + ", but the frames before are " + format_size(size) +
                       "; expected one size in the whole video");
    }
    ++count;
    return true;
  }

  Image picture() {
    rgb->width = size.width, rgb->height = size.height, rgb->format = AV_PIX_FMT_RGB24;
    if (rgb->data[0] == nullptr && av_frame_get_buffer(rgb.get(), 0) < 0) throw std::bad_alloc();
    scaler.reset(sws_getCachedContext(
        scaler.release(), size.width, size.height, static_cast<AVPixelFormat>(frame->format),
        size.width, size.height, AV_PIX_FMT_RGB24, SWS_BICUBIC, nullptr, nullptr, nullptr));
    if (!scaler) refuse();
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
  ImageSize size;  ///< of the first frame
  int64_t count = 0;
  bool drained = false;
};

VideoFile::VideoFile(const std::filesystem::path& path) : impl_(std::make_unique<Impl>(path)) {}
VideoFile::~VideoFile() = default;
VideoFile::VideoFile(VideoFile&&) noexcept = default;

double VideoFile::rate_hz() const {
  const double rate = av_q2d(av_guess_frame_rate(impl_->format.get(), impl_->stream, nullptr));
  return std::isfinite(rate) && rate > 0 ? rate : 0;
}

int64_t VideoFile::announced_frames() const {
  if (impl_->stream->nb_frames > 0) return impl_->stream->nb_frames;
  const double seconds = static_cast<double>(impl_->format->duration) / AV_TIME_BASE;
  const double frames = std::floor(seconds * rate_hz() + 0.5);
  return frames > 0 && frames < 1e12 ? static_cast<int64_t>(frames) : 0;
}

std::optional<Image> VideoFile::next() {
  if (!impl_->decode()) return std::nullopt;
  return impl_->picture();
}

bool VideoFile::skip() { return impl_->decode(); }

}  // namespace v3d::ctl
