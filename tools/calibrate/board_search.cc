#include "calibrate/board_search.h"

#include <tbb/parallel_for.h>

#include "base/error.h"
#include "base/image_size.h"
#include "common/console.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::calibrate {
namespace {

using calib::BoardDetector;
using calib::BoardSighting;

constexpr size_t kBatch = 8;
constexpr size_t kMostExplained = 6;

std::vector<Picture> next_batch(PictureSource& source) {
  std::vector<Picture> batch;
  while (batch.size() < kBatch) {
    auto picture = source.next();
    if (!picture) break;
    batch.push_back(std::move(*picture));
  }
  return batch;
}

void require_one_size(const std::string& camera, const Picture& picture, FoundBoards& found) {
  if (found.pictures == 0) found.size = picture.image.size;
  if (picture.image.size == found.size) return;
  throw InputError(camera + ": " + picture.name + " is " + format_size(picture.image.size) +
                   ", those before are " + format_size(found.size));
}

/// Pictures without the board, a few and spread out, to ask what else is in them.
class Puzzling {
 public:
  void add(Picture picture) {
    if (seen_++ % stride_ != 0) return;
    kept_.push_back(std::move(picture));
    if (kept_.size() < 2 * kMostExplained) return;
    for (size_t i = 0; i < kMostExplained; ++i) kept_[i] = std::move(kept_[2 * i]);
    kept_.resize(kMostExplained);
    stride_ *= 2;
  }

  std::optional<std::string> explain(const BoardDetector& detector) const {
    for (const Picture& picture : kept_) {
      if (auto clue = detector.explain(picture.image.view())) return picture.name + ": " + *clue;
    }
    return std::nullopt;
  }

 private:
  std::vector<Picture> kept_;
  size_t seen_ = 0;
  size_t stride_ = 1;
};

void keep(Picture& picture, BoardSighting sighting, FoundBoards& found) {
  int most = 0;
  for (const auto& view : found.views) most = std::max(most, view.sighting.count());
  if (sighting.count() > most) found.example = std::move(picture.image);
  found.views.push_back({picture.name, std::move(sighting)});
  found.numbers.push_back(picture.number);
}

void require_boards(const std::string& camera, const PictureSource& source,
                    const FoundBoards& found, const calib::Board& board) {
  if (found.pictures == 0) throw InputError(camera + ": " + source.name + ": holds no picture");
  if (!found.views.empty()) return;
  if (found.clue) throw InputError(camera + ": " + *found.clue);
  throw InputError(camera + ": too few boards: no " + board.text() + " in any of " +
                   ctl::count_of(found.pictures, "picture") + " of " + source.name +
                   ": is it whole in the picture, flat, sharp and lit?");
}

}  // namespace

FoundBoards find_boards(const std::string& camera, PictureSource source,
                        const BoardDetector& detector) {
  FoundBoards found;
  Puzzling puzzling;
  Progress progress("boards of " + camera, source.announced);
  while (true) {
    std::vector<Picture> batch = next_batch(source);
    if (batch.empty()) break;
    std::vector<std::optional<BoardSighting>> sightings(batch.size());
    tbb::parallel_for(size_t{0}, batch.size(),
                      [&](size_t i) { sightings[i] = detector.find(batch[i].image.view()); });
    for (size_t i = 0; i < batch.size(); ++i) {
      require_one_size(camera, batch[i], found);
      ++found.pictures;
      progress.advance();
      if (sightings[i]) {
        keep(batch[i], std::move(*sightings[i]), found);
      } else {
        puzzling.add(std::move(batch[i]));
      }
    }
    ctl::stop_if_interrupted();
  }
  if (found.views.empty()) found.clue = puzzling.explain(detector);
  require_boards(camera, source, found, detector.board());
  return found;
}

}  // namespace v3d::calibrate
