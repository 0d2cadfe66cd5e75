#include "v3dctl/scene/scene_video.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/image/image.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Prevents ffmpeg from parsing a relative path that begins with '-' as an option.
std::string file_word(const fs::path& path) { return "file:" + path.string(); }

std::vector<std::string> codec_words(const fs::path& path, const VideoOptions& options) {
  using enum VideoOptions::Codec;
  const auto quality = [&](int usual) {
    return std::to_string(options.quality > 0 ? options.quality : usual);
  };
  VideoOptions::Codec codec = options.codec;
  if (codec == kByName) codec = path.extension() == ".webm" ? kVp9 : kH264;
  if (codec == kH264) {
    std::vector<std::string> words{"-c:v", "libx264", "-crf", quality(18)};
    if (!options.level.empty()) words.insert(words.end(), {"-level", options.level});
    return words;
  }
  if (codec == kVp9) return {"-c:v", "libvpx-vp9", "-crf", quality(24), "-b:v", "0"};
  return {"-c:v", "libaom-av1", "-crf", quality(30), "-b:v", "0", "-cpu-used", "6", "-row-mt", "1"};
}

std::vector<std::string> writer_words(const fs::path& path, ImageSize size, double rate_hz,
                                      const VideoOptions& options) {
  if (size.width % 2 != 0 || size.height % 2 != 0) {
    throw InputError("--size " + format_size(size) +
                     ": expected an even width and height for a video");
  }
  std::vector<std::string> words{"ffmpeg",
                                 "-hide_banner",
                                 "-loglevel",
                                 "error",
                                 "-y",
                                 "-f",
                                 "rawvideo",
                                 "-pixel_format",
                                 "rgb24",
                                 "-video_size",
                                 format_size(size),
                                 "-framerate",
                                 frame_rate(rate_hz),
                                 "-i",
                                 "pipe:0"};
  const auto add = [&](const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
  };
  if (!options.sound.empty()) {
    // Matroska states no delay of an AAC encoder.
    const bool opus = path.extension() == ".webm" || path.extension() == ".mkv";
    add({"-i", file_word(options.sound), "-c:a", opus ? "libopus" : "aac", "-b:a", "192k"});
  }
  add({"-vf", "scale=out_color_matrix=bt709:out_range=tv", "-pix_fmt", "yuv420p"});
  add({"-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"});
  add(codec_words(path, options));
  if (!options.key_pictures.empty()) {
    add({"-force_key_frames", key_picture_times(options.key_pictures, rate_hz)});
  }
  if (!options.timecode.empty()) add({"-timecode", options.timecode});
  // The index comes first, so that a browser starts before it has the whole file.
  if (path.extension() == ".mp4" || path.extension() == ".mov") add({"-movflags", "+faststart"});
  words.push_back(file_word(path));
  return words;
}

std::vector<std::string> reader_words(const fs::path& path, ImageSize size, double rate_hz) {
  const std::string w = std::to_string(size.width), h = std::to_string(size.height);
  return {"ffmpeg",
          "-hide_banner",
          "-loglevel",
          "error",
          "-nostdin",
          "-i",
          file_word(path),
          "-an",
          "-vf",
          "fps=" + frame_rate(rate_hz) + ",scale=" + w + ":" + h +
              ":force_original_aspect_ratio=increase,crop=" + w + ":" + h,
          "-f",
          "rawvideo",
          "-pix_fmt",
          "rgb24",
          "pipe:1"};
}

/// Reads the next line of a program's output; returns false after the last.
bool read_line(const ProcessStream& stream, std::string& line) {
  line.clear();
  for (uint8_t byte = 0; stream.read({&byte, 1});) {
    if (byte == '\n') return true;
    line += static_cast<char>(byte);
  }
  return !line.empty();
}

/// Returns `path`. Throws InputError if the frames of the video have different sizes, because
/// ffmpeg would scale them without a message. Decodes the whole video.
fs::path require_one_size(fs::path path) {
  ProcessStream ffprobe({"ffprobe", "-v", "quiet", "-select_streams", "v:0", "-show_entries",
                         "frame=width,height", "-of", "csv=p=0:s=x", file_word(path)},
                        ProcessStream::End::kStdout);
  std::string size, first;
  for (int64_t frame = 0; read_line(ffprobe, size); ++frame) {
    while (size.ends_with('x')) size.pop_back();  // a separator, where the frame has side data
    if (size.empty()) break;
    if (first.empty()) first = size;
    if (size == first) continue;
    throw InputError(path.string() + " frame " + std::to_string(frame) + ": is " + size +
                     ", but the frames before are " + first +
                     "; expected one size in the whole video");
  }
  return path;
}

}  // namespace

std::string frame_rate(double rate_hz) {
  constexpr double kNtsc = 1.001;
  const int64_t whole = std::llround(rate_hz * kNtsc);
  if (std::abs(static_cast<double>(whole) / kNtsc - rate_hz) > 1e-6) return std::to_string(rate_hz);
  return std::to_string(1000 * whole) + "/1001";
}

std::string key_picture_times(const std::vector<int64_t>& pictures, double rate_hz) {
  std::string times;
  for (const int64_t picture : pictures) {
    const double periods = std::max(0.0, static_cast<double>(picture) - 0.25);
    times += (times.empty() ? "" : ",") + std::to_string(periods / rate_hz);
  }
  return times;
}

bool VideoWriter::writes(const fs::path& path) {
  constexpr std::array<const char*, 4> kEndings{".mp4", ".mov", ".mkv", ".webm"};
  return std::ranges::find(kEndings, path.extension().string()) != kEndings.end();
}

VideoWriter::VideoWriter(const fs::path& path, ImageSize size, double rate_hz,
                         const VideoOptions& options)
    : path_(path),
      file_(path),
      ffmpeg_(writer_words(file_.path(), size, rate_hz, options), ProcessStream::End::kStdin) {}

void VideoWriter::add(const Image& picture) {
  if (ffmpeg_.write(picture.bytes)) return;
  throw std::runtime_error(path_.string() + ": ffmpeg could not write it");
}

void VideoWriter::close() {
  if (ffmpeg_.finish() != 0) {
    throw std::runtime_error(path_.string() + ": ffmpeg could not write it");
  }
  file_.finish();
}

VideoReader::VideoReader(fs::path path, ImageSize size, double rate_hz)
    : path_(require_one_size(std::move(path))),
      ffmpeg_(reader_words(path_, size, rate_hz), ProcessStream::End::kStdout),
      shown_(size, PixelFormat::kRGB8),
      decoded_(size, PixelFormat::kRGB8) {}

const Image& VideoReader::picture(int64_t number) {
  for (; next_ <= number && !ended_; ++next_) {
    ended_ = !ffmpeg_.read(decoded_.bytes);
    if (!ended_) std::swap(shown_, decoded_);
    if (ended_ && next_ == 0) throw InputError(path_.string() + ": ffmpeg finds no video in it");
  }
  return shown_;
}

}  // namespace v3d::ctl
