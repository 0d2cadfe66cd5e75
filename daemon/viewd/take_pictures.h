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

/// Takes without raw frames in their folder get 404. A matching ETag is answered at once; other
/// answers are deferred work (WebAnswer::work). One thread; the work runs on any other.
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
  const std::shared_ptr<TakePhotographs> photographs_;  ///< used by deferred work only
  const std::shared_ptr<TakeViews> views_;              ///< used by deferred work only
};

}  // namespace v3d
