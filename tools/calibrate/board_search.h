// Search for the board in all images of one camera.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/boards/board_detector.h"
#include "calib/lens/lens_fit.h"
#include "calibrate/image_source.h"

namespace v3d::calibrate {

struct FoundBoards {
  ImageSize size;
  int64_t images = 0;                  ///< number of searched images
  std::vector<calib::LensView> views;  ///< the images with the board
  std::vector<int64_t> numbers;        ///< SourceImage::number of each view
  std::optional<Image> example;        ///< the image with most corners
  /// Where no image shows the board: what is recognised instead, if anything.
  std::optional<std::string> diagnosis;
};

/// Searches all images, several in parallel. Throws InputError for images of different sizes, for a
/// source without images, and where no image shows the board; the message then has the diagnosis.
FoundBoards find_boards(const std::string& camera, ImageSource source,
                        const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
