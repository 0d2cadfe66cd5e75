#include "v3dctl/scene_video.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/image_size.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// A relative path may begin with '-': ffmpeg is not to take it for an option.
std::string file_word(const fs::path& path) { return "file:" + path.string(); }

std::vector<std::string> writer_words(const fs::path& path, ImageSize size, double rate_hz) {
  if (size.width % 2 != 0 || size.height % 2 != 0) {
    throw InputError("--size " + format_size(size) + ": a video wants even numbers");
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
                                 std::to_string(rate_hz),
                                 "-i",
                                 "pipe:0",
                                 "-vf",
                                 "scale=out_color_matrix=bt709:out_range=tv",
                                 "-pix_fmt",
                                 "yuv420p",
                                 "-colorspace",
                                 "bt709",
                                 "-color_primaries",
                                 "bt709",
                                 "-color_trc",
                                 "bt709"};
  const bool webm = path.extension() == ".webm";
  for (const char* word :
       webm ? std::vector<const char*>{"-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0"}
            : std::vector<const char*>{"-c:v", "libx264", "-crf", "18"}) {
    words.emplace_back(word);
  }
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
          "fps=" + std::to_string(rate_hz) + ",scale=" + w + ":" + h +
              ":force_original_aspect_ratio=increase,crop=" + w + ":" + h,
          "-f",
          "rawvideo",
          "-pix_fmt",
          "rgb24",
          "pipe:1"};
}

}  // namespace

bool VideoWriter::writes(const fs::path& path) {
  constexpr std::array<const char*, 4> kEndings{".mp4", ".mov", ".mkv", ".webm"};
  return std::ranges::find(kEndings, path.extension().string()) != kEndings.end();
}

VideoWriter::VideoWriter(const fs::path& path, ImageSize size, double rate_hz)
    : path_(path), ffmpeg_(writer_words(path, size, rate_hz), ProcessStream::End::kItsInput) {}

void VideoWriter::add(const Image& picture) {
  if (ffmpeg_.write(picture.bytes)) return;
  throw std::runtime_error(path_.string() + ": ffmpeg could not write it");
}

void VideoWriter::close() {
  if (ffmpeg_.finish() == 0) return;
  throw std::runtime_error(path_.string() + ": ffmpeg could not write it");
}

VideoReader::VideoReader(fs::path path, ImageSize size, double rate_hz)
    : path_(std::move(path)),
      ffmpeg_(reader_words(path_, size, rate_hz), ProcessStream::End::kItsOutput),
      shown_(size, PixelFormat::kRGB8),
      coming_(size, PixelFormat::kRGB8) {}

const Image& VideoReader::picture(int64_t number) {
  for (; next_ <= number && !ended_; ++next_) {
    ended_ = !ffmpeg_.read(coming_.bytes);
    if (!ended_) std::swap(shown_, coming_);
    if (ended_ && next_ == 0) throw InputError(path_.string() + ": ffmpeg finds no video in it");
  }
  return shown_;
}

}  // namespace v3d::ctl
