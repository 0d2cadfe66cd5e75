#include <strings.h>

#include <algorithm>
#include <map>
#include <type_traits>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/natural_order.h"
#include "v3dctl/import/import.h"
#include "v3dctl/import/media.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using ImagesByCamera = std::map<std::string, std::vector<fs::path>>;

void require_folder(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": is no folder of images");
}

std::string camera_names(const Rig& rig) {
  std::vector<std::string> names;
  for (const RigCamera& camera : rig) names.push_back(camera.name);
  return join_names(names);
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory() || has_image_name(entry.path())) entries.push_back(entry.path());
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

ImagesByCamera images_by_camera(const fs::path& folder, const Rig& rig) {
  require_folder(folder);
  ImagesByCamera images;
  for (const fs::path& entry : entries_of(folder)) {
    const bool is_folder = fs::is_directory(entry);
    const std::vector<fs::path> files = is_folder ? images_in(entry) : std::vector{entry};
    if (files.empty()) continue;
    const std::string camera = is_folder ? entry.filename() : entry.stem();
    if (find_camera(rig, camera) < 0) {
      throw InputError(entry.string() + ": no camera " + camera +
                       " in the calibration; expected one of " + camera_names(rig));
    }
    if (!images.emplace(camera, files).second) {
      throw InputError(entry.string() + ": " + camera + " has images of another kind, too: " +
                       images[camera].front().string() + "; expected one kind");
    }
  }
  return images;
}

// Frames are matched by name. A single image is named after its camera and matches any other one.
std::vector<std::string> frame_names(const std::vector<fs::path>& files,
                                     const std::string& camera) {
  std::vector<std::string> names;
  for (const fs::path& file : files) names.push_back(file.stem() == camera ? "" : file.stem());
  return names;
}

void require_same_frames(const ImageSequence& a, const std::vector<fs::path>& b_files,
                         const std::string& b_camera, const std::string& what) {
  const std::vector<std::string> a_names = frame_names(a.images, a.camera);
  const std::vector<std::string> b_names = frame_names(b_files, b_camera);
  if (a_names == b_names) return;
  const size_t both = std::min(a_names.size(), b_names.size());
  const auto [a_at, b_at] =
      std::mismatch(a_names.begin(), a_names.begin() + static_cast<long>(both), b_names.begin());
  const size_t at = static_cast<size_t>(a_at - a_names.begin());
  const std::string first = at < both || at < a_names.size() ? a.images[at] : b_files[at];
  throw InputError(what + ": frames differ, first at " + first + ": " +
                   std::to_string(a_names.size()) + " against " + std::to_string(b_names.size()) +
                   " images; expected the same frame names for every camera");
}

void attach_masks(std::vector<ImageSequence>& sequences, const fs::path& folder, const Rig& rig) {
  ImagesByCamera masks = images_by_camera(folder, rig);
  for (ImageSequence& sequence : sequences) {
    const auto found = masks.find(sequence.camera);
    if (found == masks.end()) {
      throw InputError(folder.string() + ": no mask for " + sequence.images.front().string());
    }
    require_same_frames(sequence, found->second, sequence.camera, "masks of " + sequence.camera);
    sequence.masks = std::move(found->second);
    masks.erase(found);
  }
  if (!masks.empty()) {
    throw InputError(masks.begin()->second.front().string() + ": is a mask without an image");
  }
}

class ImageSource : public FrameSource {
 public:
  explicit ImageSource(ImageSequence sequence) : sequence_(std::move(sequence)) {}

  std::optional<SourceImage> next() override {
    if (index_ == sequence_.images.size()) return std::nullopt;
    SourceImage image{read_image(sequence_.images[index_]), std::nullopt, sequence_.images[index_],
                      ""};
    if (!sequence_.masks.empty()) {
      image.mask_where = sequence_.masks[index_];
      image.mask = read_mask(sequence_.masks[index_]);
    }
    ++index_;
    return image;
  }
  bool skip() override {
    if (index_ == sequence_.images.size()) return false;
    ++index_;
    return true;
  }
  std::string name() const override { return sequence_.images.front().parent_path(); }
  int64_t announced() const override { return static_cast<int64_t>(sequence_.images.size()); }
  double rate_hz() const override { return 0; }

 private:
  ImageSequence sequence_;
  size_t index_ = 0;
};

class VideoSource : public FrameSource {
 public:
  explicit VideoSource(const fs::path& file) : file_(file), video_(file) {
    video_.require_constant_rate();  // frames of several videos are joined by their numbers
  }

  std::optional<SourceImage> next() override {
    std::optional<Image> image = with_remedy([&] { return video_.next(); });
    if (!image) return std::nullopt;
    const std::string where = file_.string() + " frame " + std::to_string(index_++);
    return SourceImage{*std::move(image), std::nullopt, where, ""};
  }
  bool skip() override {
    if (!with_remedy([&] { return video_.skip(); })) return false;
    ++index_;
    return true;
  }
  std::string name() const override { return file_; }
  int64_t announced() const override { return video_.announced_frames(); }
  double rate_hz() const override { return video_.rate_hz(); }

 private:
  /// Reads a frame. An InputError then names the option that selects the frames before.
  template <class Read>
  std::invoke_result_t<Read> with_remedy(Read read) {
    try {
      return read();
    } catch (const InputError& error) {
      if (index_ == 0) throw;
      throw InputError(std::string(error.what()) + "; --frames 0:" + std::to_string(index_) +
                       " selects the frames before");
    }
  }

  fs::path file_;
  VideoFile video_;
  int64_t index_ = 0;
};

}  // namespace

std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (!entry.is_directory() && has_image_name(entry.path())) files.push_back(entry.path());
  }
  std::ranges::sort(files, is_before_by_numbers);
  return files;
}

std::vector<ImageSequence> find_images(const fs::path& images, const fs::path& masks,
                                       const Rig& rig) {
  ImagesByCamera found_images = images_by_camera(images, rig);
  std::vector<ImageSequence> sequences;
  for (const RigCamera& camera : rig) {
    const auto found = found_images.find(camera.name);
    if (found != found_images.end()) {
      sequences.push_back({camera.name, std::move(found->second), {}});
    }
  }
  if (sequences.empty()) {
    throw InputError(images.string() +
                     ": has no images; expected CAM.png or CAM/FRAME.png for cameras " +
                     camera_names(rig));
  }
  for (const ImageSequence& sequence : sequences) {
    require_same_frames(sequences.front(), sequence.images, sequence.camera,
                        sequences.front().camera + " and " + sequence.camera);
  }
  if (!masks.empty()) attach_masks(sequences, masks, rig);
  return sequences;
}

std::unique_ptr<FrameSource> open_images(ImageSequence sequence) {
  return std::make_unique<ImageSource>(std::move(sequence));
}

std::unique_ptr<FrameSource> open_video(const fs::path& file) {
  return std::make_unique<VideoSource>(file);
}

}  // namespace v3d::ctl
