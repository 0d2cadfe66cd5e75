// Images for calibration and boards in them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/image/image.h"
#include "calib/boards/detectors.h"
#include "calib/lens/lens_fit.h"

namespace v3d::calibrate {

// Sequences of calibration images: image files, a video, or the frames of a take.

/// One image. `number`: of the frame in its video, the pulse in its take, or the file in its list.
struct CalibrationImage {
  int64_t number = 0;
  std::string name;  ///< for messages: "left01.jpg", "frame 27"
  Image pixels;
};

/// A sequence of images. next() returns nothing after the last image, and throws InputError for
/// files that cannot be read. Use it in one thread.
struct ImageSource {
  std::string name;       ///< of the file or folder
  int64_t announced = 0;  ///< approximate number of images; 0: unknown
  std::function<std::optional<CalibrationImage>()> next;
  /// Of a video: the number of frames up to here, also of those that next() left out. Else empty.
  std::function<int64_t()> frames{};
};

/// Takes every `every`th frame; 0: chosen so that there are at most about `max_images`, for several
/// cameras by the one with most frames. All cameras have the same interval, so that they contribute
/// the same instants.
struct Sampling {
  int every = 0;
  int max_images = 300;
  /// Takes runs of so many consecutive frames, at intervals that are longer by this factor: the
  /// time offset of two cameras only shows in consecutive frames.
  int run = 1;
};

/// Files that match a shell pattern ("boards/left*.jpg"), in natural order of their numbers.
std::vector<std::filesystem::path> matching_files(const std::string& pattern);

/// One source for each video, in the given order. Throws InputError for a file that is no video.
std::vector<ImageSource> open_videos(const std::vector<std::filesystem::path>& files,
                                     const Sampling& sampling);
/// The images among matching_files(). Throws InputError where there is none.
ImageSource open_images(const std::string& pattern);
/// The frames of each of these cameras of a take. Throws InputError for a camera without frames.
std::vector<ImageSource> open_take(const std::filesystem::path& take,
                                   const std::vector<std::string>& cameras,
                                   const Sampling& sampling);

// Recording a short take with the running studio, as a source of calibration images.

/// Records the take calibration-<date>-<time> of `seconds` with at most 5 pulses per second,
/// through the operator's protocol, and returns its folder.
///
/// The folder is that of the recording where this PC has all cameras; else the take is collected
/// from the nodes into the current folder. The take is kept. Progress, missing frames and the
/// folder are printed on stderr. Throws InputError where the studio cannot be reached or collected
/// from, and std::runtime_error where a node rejects the recording or the user interrupts it.
std::filesystem::path record_live_take(const Studio& studio, double seconds);

// Search for the board in all images of one camera.

struct FoundBoards {
  ImageSize size;
  int64_t images = 0;                  ///< number of searched images
  int64_t frames = 0;                  ///< of a video: all its frames; else 0
  std::vector<calib::LensView> views;  ///< the images with the board
  std::vector<int64_t> numbers;        ///< CalibrationImage::number of each view
  std::optional<Image> example;        ///< the image with most corners
  /// Where no image shows the board: what is recognised instead, if anything.
  std::optional<std::string> diagnosis;
};

/// Searches all images, several in parallel. Throws InputError for images of different sizes, for a
/// source without images, and where no image shows the board; the message then has the diagnosis.
FoundBoards find_boards(const std::string& camera, ImageSource source,
                        const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
