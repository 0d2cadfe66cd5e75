// What is served, by its path:
//   /, /...                      the page
//   /api/takes                   the takes (takes_json)
//   /api/scenes                  the scenes (scenes_json)
//   /api/rig, /api/takes/T/rig   the calibration now, and that of a take (rig_json)
//   /api/order                   GET: the last order and what came of it (order_json); POST: an
//                                order (operator_desk.h), the only thing that is no look
//   /api/takes/T/photographs/... what the cameras saw (take_pictures.h)
//   /api/live, /api/studio       by WebSocket only: live meshes, and the studio's state
//   /takes/T/FILE                mesh.v3d or calib.toml of a take, or scene.json and what is shown
//                                with it (scene_folders.h), as it lies there; HTTP ranges
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "daemon/viewd/command_endpoint.h"
#include "daemon/viewd/connection_slots.h"
#include "daemon/viewd/page_files.h"
#include "daemon/viewd/take_pictures.h"
#include "daemon/viewd/web_access.h"
#include "daemon/viewd/web_message.h"
#include "take/take_listing.h"

namespace v3d {

/// Answers requests; changes nothing in the world but what the operators' desk takes. One thread;
/// the work of its answers is done on any other, one at a time, and may outlive it.
class WebSite {
 public:
  /// The takes of a folder, oldest first. Used on the thread that lists folders.
  using ListTakes = std::function<std::vector<TakeListing>(const std::filesystem::path& folder)>;
  static std::vector<TakeListing> list_takes(const std::filesystem::path& folder);
  /// Of more takes the newest are shown.
  static constexpr size_t kMaxListed = 10'000;

  /// `desk` outlives it.
  WebSite(const Studio& studio, WebAccess access, std::map<std::string, PageFile> page,
          CommandEndpoint& desk, const ListTakes& list = list_takes);

  /// Never throws: what goes wrong is a status.
  WebAnswer answer(const WebRequest& request);

  /// Who has sent a request: a stranger where answer() would refuse it for its sender.
  Visitor visitor(const WebRequest& request) const;

  enum class StreamKind : uint8_t { kLive, kStudio };
  /// Of a request to open a WebSocket: which, or why not.
  struct Opening {
    std::optional<StreamKind> stream;
    WebAnswer refusal;
  };
  Opening open_stream(const WebRequest& request) const;

 private:
  class CachedListing;

  std::optional<WebAnswer> refusal(const WebRequest& request,
                                   const std::optional<WebTarget>& target) const;
  WebAnswer find(const WebRequest& request, const WebTarget& target);
  WebAnswer of_take(const WebRequest& request, const std::string& take, const std::string& file);

  const std::filesystem::path takes_;
  const std::filesystem::path calib_;
  const WebAccess access_;
  const std::map<std::string, PageFile> page_;
  CommandEndpoint& desk_;
  const TakePictures pictures_;
  const std::shared_ptr<CachedListing> take_listing_;
  const std::shared_ptr<CachedListing> scene_listing_;
};

}  // namespace v3d
