#include "v3dctl/import/frame_source.h"

#include "v3dctl/import/image_file.h"
#include "v3dctl/import/video_file.h"

namespace v3d::ctl {
namespace {

class ImageSource : public FrameSource {
 public:
  explicit ImageSource(ImageSequence sequence) : sequence_(std::move(sequence)) {}

  std::optional<Picture> next() override {
    if (at_ == sequence_.images.size()) return std::nullopt;
    Picture picture{read_image(sequence_.images[at_]), std::nullopt, sequence_.images[at_], ""};
    if (!sequence_.masks.empty()) {
      picture.mask_where = sequence_.masks[at_];
      picture.mask = read_mask(sequence_.masks[at_]);
    }
    ++at_;
    return picture;
  }
  bool skip() override {
    if (at_ == sequence_.images.size()) return false;
    ++at_;
    return true;
  }
  std::string name() const override { return sequence_.images.front().parent_path(); }
  int64_t announced() const override { return static_cast<int64_t>(sequence_.images.size()); }
  double rate_hz() const override { return 0; }

 private:
  ImageSequence sequence_;
  size_t at_ = 0;
};

class VideoSource : public FrameSource {
 public:
  explicit VideoSource(const std::filesystem::path& file) : file_(file), video_(file) {}

  std::optional<Picture> next() override {
    std::optional<Image> image = video_.next();
    if (!image) return std::nullopt;
    const std::string where = file_.string() + " frame " + std::to_string(at_++);
    return Picture{*std::move(image), std::nullopt, where, ""};
  }
  bool skip() override {
    if (!video_.skip()) return false;
    ++at_;
    return true;
  }
  std::string name() const override { return file_; }
  int64_t announced() const override { return video_.announced_frames(); }
  double rate_hz() const override { return video_.rate_hz(); }

 private:
  std::filesystem::path file_;
  VideoFile video_;
  int64_t at_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_images(ImageSequence sequence) {
  return std::make_unique<ImageSource>(std::move(sequence));
}

std::unique_ptr<FrameSource> open_video(const std::filesystem::path& file) {
  return std::make_unique<VideoSource>(file);
}

}  // namespace v3d::ctl
