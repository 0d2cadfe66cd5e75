// What is served of the raw frames of takes, by its path:
//   /api/takes/T/photographs/PULSE/CAM.jpg   a frame (TakePhotographs)
//   /api/takes/T/views/PULSE                 what every camera says about the vertices (TakeViews)
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "daemon/viewd/web_message.h"
#include "daemon/viewd/web_target.h"

namespace v3d {

class TakePhotographs;
class TakeViews;

/// Of a take whose raw frames are not in its folder nothing is served. What a browser has already
/// (ETag) is answered at once; all else is work. One thread; the work is done on any other.
class TakePictures {
 public:
  /// `takes`: the folder that holds them.
  explicit TakePictures(const std::filesystem::path& takes);

  /// Empty for a path that is none of these.
  std::optional<WebAnswer> answer(const WebRequest& request, const WebTarget& target) const;

 private:
  WebAnswer photograph(const WebRequest& request, const std::string& take, const std::string& pulse,
                       const std::string& file) const;
  WebAnswer views(const WebRequest& request, const std::string& take,
                  const std::string& pulse) const;

  const std::filesystem::path takes_;
  const std::shared_ptr<TakePhotographs> photographs_;  ///< used by work alone
  const std::shared_ptr<TakeViews> views_;              ///< used by work alone
};

}  // namespace v3d
