// The content of the web server, by path:
//   /, /...                      the page
//   /api/takes                   the takes (takes_json)
//   /api/scenes                  the scenes (scenes_json)
//   /api/rig, /api/takes/T/rig   the current calibration, and that of a take (rig_json)
//   /api/takes/T/skeletons       the performers of a take that have a skeleton (skeletons_json)
//   /api/takes/T/sound           the sound files of a take, with its pulses (sound_json)
//   /takes/T/sound/F             a sound file of a take
//   /api/order                   GET: the last command and its result (report_json); POST: a
//   command
//                                (command_endpoint.h), the only request that changes anything
//   /api/takes/T/photographs/... images of the cameras (take_pictures.h)
//   /api/live, /api/studio       WebSockets: live meshes, and the state of the studio
//   /takes/T/FILE                mesh.v3d, proxy.v3d, motion.v3d, calib.toml, skeleton.json,
//                                skeleton.performerK.json or edit.json of a take, or scene.json
//                                and its files (served_files.h); HTTP ranges
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "daemon/viewd/command_endpoint.h"
#include "daemon/viewd/served_files.h"
#include "daemon/viewd/take_pictures.h"
#include "daemon/web/web_access.h"
#include "daemon/web/web_message.h"
#include "take/take_listing.h"

namespace v3d::viewd {

/// Responds to requests. Only the CommandEndpoint changes anything. One thread, which reads from no
/// disk; the work of responses (WebResponse::work) runs on others, and may outlive this object.
class WebSite {
 public:
  /// Returns the takes of a folder, oldest first. Called on the thread of the listings.
  using ListTakes =
      std::function<std::vector<take::TakeListing>(const std::filesystem::path& folder)>;
  /// take::find_all_takes() without the paths of folders in its errors. The name of a take is that
  /// of its folder, which is unique: a copied folder has the take.toml of another one. It keeps the
  /// listings of takes that do not change (take::TakeListingCache).
  static ListTakes make_list_takes();
  /// Limit of listed takes: the newest ones.
  static constexpr size_t kMaxListed = 10'000;

  /// `commands` must outlive this object.
  WebSite(const Studio& studio, web::WebAccess access, std::map<std::string, PageFile> page,
          CommandEndpoint& commands, const ListTakes& list = make_list_takes());

  /// Does not throw: errors become a status.
  web::WebResponse respond(const web::WebRequest& request);

  /// The role of the sender; kUnauthenticated if respond() would reject any request of this sender.
  web::ClientRole role_of(const web::WebRequest& request) const;

  enum class StreamKind : uint8_t { kLive, kStudio };
  /// The result of a request to open a WebSocket: the stream, or the refusal.
  struct Opening {
    std::optional<StreamKind> stream;
    web::WebResponse refusal;
  };
  Opening open_stream(const web::WebRequest& request) const;

  /// TakePictures::closing(). Any thread.
  web::WebResponse closing() const { return pictures_.closing(); }

 private:
  class CachedListing;

  std::optional<web::WebResponse> refusal(const web::WebRequest& request,
                                          const std::optional<web::WebTarget>& target) const;
  web::WebResponse find(const web::WebRequest& request, const web::WebTarget& target) const;
  web::WebResponse take_skeletons(const std::string& take) const;
  web::WebResponse take_sound(const std::string& take) const;
  web::WebResponse sound_file(const web::WebRequest& request, const std::string& take,
                              const std::string& file) const;
  web::WebResponse take_file(const web::WebRequest& request, const std::string& take,
                             const std::string& file) const;

  const std::filesystem::path takes_;
  const std::filesystem::path calib_;
  const web::WebAccess access_;
  const std::map<std::string, PageFile> page_;
  CommandEndpoint& commands_;
  const TakePictures pictures_;
  const std::shared_ptr<CachedListing> take_listing_;
  const std::shared_ptr<CachedListing> scene_listing_;
};

/// A WebSite with its WebSockets, for the server.
class SiteHandler final : public web::WebHandler {
 public:
  using Subscribe = std::function<std::unique_ptr<web::WebStream>(WebSite::StreamKind)>;
  /// `site` and the objects that `subscribe` uses must outlive this object.
  SiteHandler(WebSite& site, Subscribe subscribe) : site_(site), subscribe_(std::move(subscribe)) {}

  web::WebResponse respond(const web::WebRequest& request) override {
    return site_.respond(request);
  }
  web::ClientRole role_of(const web::WebRequest& request) const override {
    return site_.role_of(request);
  }
  Opening open_stream(const web::WebRequest& request) override;

 private:
  WebSite& site_;
  const Subscribe subscribe_;
};

}  // namespace v3d::viewd
