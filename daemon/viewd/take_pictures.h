// HTTP answers from the raw frames of takes:
//   /api/takes/T/photographs/PULSE/CAM.jpg   a frame (TakePhotographs)
//   /api/takes/T/views/PULSE                 vertex colours by camera (TakeViews)
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "daemon/web/web_message.h"
#include "daemon/web/web_target.h"

namespace v3d {

class TakePhotographs;
class TakeViews;

/// Takes without raw frames in their folder get 404. Valid requests are answered by work
/// (WorkKind::kPicture), which runs on one other thread at a time.
class TakePictures {
 public:
  /// `takes`: the folder of the takes.
  explicit TakePictures(const std::filesystem::path& takes);

  /// Empty for other paths.
  std::optional<WebAnswer> answer(const WebRequest& request, const WebTarget& target) const;

 private:
  WebAnswer photograph(const WebRequest& request, const std::string& take, const std::string& pulse,
                       const std::string& file) const;
  WebAnswer views(const WebRequest& request, const std::string& take,
                  const std::string& pulse) const;

  const std::filesystem::path takes_;
  const std::shared_ptr<TakePhotographs> photographs_;  ///< used by the work only
  const std::shared_ptr<TakeViews> views_;              ///< used by the work only
};

}  // namespace v3d
