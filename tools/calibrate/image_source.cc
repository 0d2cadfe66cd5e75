#include "calibrate/image_source.h"

#include <glob.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "base/core/error.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "v3dctl/import/image_file.h"
#include "v3dctl/import/video_file.h"

namespace v3d::calibrate {
namespace {

namespace fs = std::filesystem;

int64_t stride_of(int64_t announced, const Sampling& sampling) {
  if (sampling.every > 0) return sampling.every;
  return std::max<int64_t>(1, (announced + sampling.max_images - 1) / sampling.max_images);
}

std::string frame_name(int64_t number) { return "frame " + std::to_string(number); }

}  // namespace

std::vector<fs::path> matching_files(const std::string& pattern) {
  glob_t found{};
  glob(pattern.c_str(), GLOB_TILDE, nullptr, &found);
  std::vector<fs::path> files(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  globfree(&found);
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return strverscmp(a.c_str(), b.c_str()) < 0;
  });
  return files;
}

ImageSource open_video(const fs::path& file, const Sampling& sampling) {
  auto reader = std::make_shared<ctl::VideoFile>(file);
  const int64_t stride = stride_of(reader->announced_frames(), sampling);
  ImageSource source{file.string(), reader->announced_frames() / stride, {}};
  source.next = [reader, stride, number = int64_t{0}]() mutable -> std::optional<SourceImage> {
    for (; number % stride != 0; ++number) {
      if (!reader->skip()) return std::nullopt;
    }
    auto image = reader->next();
    if (!image) return std::nullopt;
    const int64_t here = number++;
    return SourceImage{here, frame_name(here), std::move(*image)};
  };
  return source;
}

ImageSource open_images(const std::string& pattern) {
  std::vector<fs::path> files = matching_files(pattern);
  std::erase_if(files, [](const fs::path& file) { return !ctl::has_image_name(file); });
  if (files.empty()) {
    throw InputError(pattern + ": no image matches (quote the pattern: 'boards/*.png')");
  }
  ImageSource source{pattern, std::ssize(files), {}};
  source.next = [files, position = size_t{0}]() mutable -> std::optional<SourceImage> {
    if (position == files.size()) return std::nullopt;
    const fs::path& file = files[position];
    return SourceImage{static_cast<int64_t>(position++), file.filename().string(),
                       ctl::read_image(file)};
  };
  return source;
}

ImageSource open_take(const fs::path& take, const std::string& camera, const Sampling& sampling) {
  const TakePaths paths{take};
  auto log = std::make_shared<FrameLogReader>(paths.frames(camera));
  std::vector<int64_t> pulses;
  for (const FrameLabel& label : log->labels()) pulses.push_back(label.pulse);
  std::sort(pulses.begin(), pulses.end());
  pulses.erase(std::unique(pulses.begin(), pulses.end()), pulses.end());
  const int64_t last = pulses.empty() ? 0 : pulses.back() + 1;
  const int64_t stride = stride_of(last, sampling);
  // By pulse number, so that all cameras contribute the same pulses.
  std::erase_if(pulses, [&](int64_t pulse) { return pulse % stride != 0; });
  ImageSource source{paths.frames(camera).string(), std::ssize(pulses), {}};
  source.next = [log, pulses, position = size_t{0}]() mutable -> std::optional<SourceImage> {
    while (position < pulses.size()) {
      const int64_t pulse = pulses[position++];
      if (auto frame = log->read(pulse)) {
        return SourceImage{pulse, "pulse " + std::to_string(pulse), std::move(frame->image)};
      }
    }
    return std::nullopt;
  };
  return source;
}

}  // namespace v3d::calibrate
