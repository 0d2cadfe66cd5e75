#include "calibrate/board_search.h"

#include <tbb/parallel_for.h>

#include "base/core/error.h"
#include "base/image/image_size.h"
#include "common/console.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::calibrate {
namespace {

using calib::BoardDetector;
using calib::BoardObservation;

constexpr size_t kBatch = 8;
constexpr size_t kMaxDiagnosed = 6;

std::vector<SourceImage> next_batch(ImageSource& source) {
  std::vector<SourceImage> batch;
  while (batch.size() < kBatch) {
    auto image = source.next();
    if (!image) break;
    batch.push_back(std::move(*image));
  }
  return batch;
}

void require_one_size(const std::string& camera, const SourceImage& image, FoundBoards& found) {
  if (found.images == 0) found.size = image.pixels.size;
  if (image.pixels.size == found.size) return;
  throw InputError(camera + ": " + image.name + " is " + format_size(image.pixels.size) +
                   ", the images before it are " + format_size(found.size));
}

/// A few evenly spaced images without the board, for the diagnosis.
class ImagesWithoutBoard {
 public:
  void add(SourceImage image) {
    if (seen_++ % stride_ != 0) return;
    kept_.push_back(std::move(image));
    if (kept_.size() < 2 * kMaxDiagnosed) return;
    for (size_t i = 0; i < kMaxDiagnosed; ++i) kept_[i] = std::move(kept_[2 * i]);
    kept_.resize(kMaxDiagnosed);
    stride_ *= 2;
  }

  std::optional<std::string> diagnose(const BoardDetector& detector) const {
    for (const SourceImage& image : kept_) {
      if (auto diagnosis = detector.diagnose(image.pixels.view()))
        return image.name + ": " + *diagnosis;
    }
    return std::nullopt;
  }

 private:
  std::vector<SourceImage> kept_;
  size_t seen_ = 0;
  size_t stride_ = 1;
};

void add_view(SourceImage& image, BoardObservation observation, FoundBoards& found) {
  int max_count = 0;
  for (const auto& view : found.views) max_count = std::max(max_count, view.observation.count());
  if (observation.count() > max_count) found.example = std::move(image.pixels);
  found.views.push_back({image.name, std::move(observation)});
  found.numbers.push_back(image.number);
}

void require_boards(const std::string& camera, const ImageSource& source, const FoundBoards& found,
                    const calib::Board& board) {
  if (found.images == 0) throw InputError(camera + ": " + source.name + ": contains no image");
  if (!found.views.empty()) return;
  if (found.diagnosis) throw InputError(camera + ": " + *found.diagnosis);
  throw InputError(camera + ": too few boards: no " + board.text() + " in any of " +
                   ctl::count_of(found.images, "image") + " of " + source.name +
                   ": is it completely visible, flat, sharp and well lit?");
}

}  // namespace

FoundBoards find_boards(const std::string& camera, ImageSource source,
                        const BoardDetector& detector) {
  FoundBoards found;
  ImagesWithoutBoard without_board;
  Progress progress("boards of " + camera, source.announced);
  while (true) {
    std::vector<SourceImage> batch = next_batch(source);
    if (batch.empty()) break;
    std::vector<std::optional<BoardObservation>> observations(batch.size());
    tbb::parallel_for(size_t{0}, batch.size(),
                      [&](size_t i) { observations[i] = detector.find(batch[i].pixels.view()); });
    for (size_t i = 0; i < batch.size(); ++i) {
      require_one_size(camera, batch[i], found);
      ++found.images;
      progress.advance();
      if (observations[i]) {
        add_view(batch[i], std::move(*observations[i]), found);
      } else {
        without_board.add(std::move(batch[i]));
      }
    }
    ctl::stop_if_interrupted();
  }
  if (found.views.empty()) found.diagnosis = without_board.diagnose(detector);
  require_boards(camera, source, found, detector.board());
  return found;
}

}  // namespace v3d::calibrate
