// The board found in all pictures of a camera.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/boards/board_detector.h"
#include "calib/lens/lens_fit.h"
#include "calibrate/picture_source.h"

namespace v3d::calibrate {

struct FoundBoards {
  ImageSize size;
  int64_t pictures = 0;
  std::vector<calib::LensView> views;  ///< the pictures with a board
  std::vector<int64_t> numbers;        ///< Picture::number of each
  std::optional<Image> example;        ///< the picture that shows most corners
  /// Where no picture shows the board: what they show instead, if anything.
  std::optional<std::string> clue;
};

/// Looks at all pictures, several at a time. Throws InputError for pictures of different sizes,
/// none at all, and, with what is wrong with the board, where it is in none of them.
FoundBoards find_boards(const std::string& camera, PictureSource source,
                        const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
