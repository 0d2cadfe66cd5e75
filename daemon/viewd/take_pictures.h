// Pictures of takes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/image/colour.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "daemon/viewd/request_error_log.h"
#include "daemon/viewd/served_files.h"
#include "daemon/web/web_access.h"
#include "daemon/web/web_message.h"
#include "take/logs/frame_log.h"

namespace v3d::viewd {

// HTTP responses from the raw frames of takes:
//   /api/takes/T/photographs/PULSE/CAM.jpg   a frame (TakePhotographs)
//   /api/takes/T/thumbnail.jpg               a small picture of the take (TakePhotographs)
//   /api/takes/T/views/PULSE                 vertex colours by camera (TakeViews)

class TakePhotographs;
class TakeViews;

/// Takes without raw frames in their folder get 404. Valid requests are answered by work: small
/// pictures by WorkKind::kThumbnail, the others by WorkKind::kPicture. Each kind runs on one other
/// thread at a time.
class TakePictures {
 public:
  /// `takes`: the folder of the takes.
  explicit TakePictures(const std::filesystem::path& takes);

  /// Empty for other paths.
  std::optional<web::WebResponse> respond(const web::WebRequest& request,
                                          const web::WebTarget& target) const;

  /// A response whose work closes the files that are removed or unused, as each request for a
  /// photograph or a view does. Run it every minute: a removed take keeps its disk space until
  /// then.
  web::WebResponse closing() const;

 private:
  web::WebResponse photograph(const web::WebRequest& request, const std::string& take,
                              const std::string& pulse, const std::string& file) const;
  web::WebResponse thumbnail(const web::WebRequest& request, const std::string& take) const;
  web::WebResponse views(const web::WebRequest& request, const std::string& take,
                         const std::string& pulse) const;
  template <class Make>
  web::WebResponse picture_response(Make make) const;

  const std::filesystem::path takes_;
  const std::shared_ptr<TakePhotographs> photographs_;  ///< used by the work only
  const std::shared_ptr<TakeViews> views_;              ///< used by the work only
};

// Single frames of recorded takes as JPEG images.

/// Time for which an unused file stays open, so that its disk can be unmounted later. To open a log
/// of hours again may take minutes.
inline constexpr Duration kMaxUnused = std::chrono::minutes(10);

/// Keeps the most recently used logs and their indexes open, so that a frame costs one read. One
/// thread, except thumbnail().
class TakePhotographs {
 public:
  static constexpr size_t kMaxLogs = 64;         ///< open logs: one take of a large studio
  static constexpr int kMaxThumbnailSide = 160;  ///< pixels

  /// `takes`: the folder of the takes.
  explicit TakePhotographs(std::filesystem::path takes) : takes_(std::move(takes)) {}

  /// JPEG of the whole image, with the colour correction of the take's calibration, as for its
  /// meshes. Empty if the camera has no such frame, or it is damaged. Requires that is_file_name()
  /// holds for both names. Throws InputError if the file is not a log.
  std::optional<std::vector<uint8_t>> read(const std::string& take, int64_t pulse,
                                           const std::string& camera);

  /// JPEG of a frame in the middle of the camera's log, reduced to at most kMaxThumbnailSide. Does
  /// not read the log before this frame, and keeps nothing open.
  /// Empty, throws and requires as read(). Any thread.
  std::optional<std::vector<uint8_t>> thumbnail(const std::string& take,
                                                const std::string& camera) const;

  /// Closes the logs that were not used for kMaxUnused, and those that were removed or replaced:
  /// the kernel keeps the blocks of a removed file until it is closed.
  void close_unused(MonotonicInstant now);

 private:
  /// Shortest time between two indexings of a growing log, when a frame is not found.
  static constexpr Duration kReindexPeriod = std::chrono::seconds(1);

  struct OpenLog {
    std::filesystem::path path;
    FileStamp stamp;
    MonotonicInstant opened;
    MonotonicInstant used;
    take::FrameLogReader reader;
    ColourResponse colour;
  };
  /// The open log, moved to the front of `logs_`; null if there is no such file.
  OpenLog* find(const std::string& take, const std::string& camera);
  OpenLog* open(const std::string& take, const std::string& camera, const FileStamp& stamp);
  std::optional<Frame> frame(const std::string& take, int64_t pulse, const std::string& camera);
  const std::filesystem::path takes_;
  std::list<OpenLog> logs_;
};

// Vertex colours by camera for meshes of recorded takes: the input of view-dependent rendering
// (Algorithm 2 of the paper) in the browser.

/// Keeps the most recently used takes open. In ascending order of pulses, a read decodes one mesh
/// and reads and segments the frames of one pulse. A jump also decodes the meshes since the key
/// frame, and every 32nd frame since the start of the take, from which the background model adapts
/// to the light. One caller at a time; works on several cameras in parallel.
class TakeViews {
 public:
  static constexpr size_t kMaxTakes = 4;  ///< open takes: those of a scene

  /// `takes`: the folder of the takes.
  explicit TakeViews(std::filesystem::path takes) : takes_(std::move(takes)) {}

  /// vertex_views_message() of the mesh of that pulse, in the order of its vertices. Empty if there
  /// is no such mesh. Requires is_file_name(take). Throws InputError if the take has no raw frames,
  /// or is damaged.
  std::optional<std::string> read(const std::string& take, int64_t pulse);

  /// The ETag of all files that read() uses. Empty if the take has no meshes or no raw frames. Any
  /// thread.
  static std::optional<std::string> tag(const std::filesystem::path& take);

  /// Closes the takes that were not used for kMaxUnused, and those of which a file was removed.
  void close_unused(MonotonicInstant now);

 private:
  struct OpenTake {
    std::string name;
    std::string tag;
    FileStamp mesh;
    MonotonicInstant used;
    std::unique_ptr<recorded::MeshFrames> meshes;
    recorded::TakeFrames frames;
    std::vector<int64_t> pulses;  ///< that have a mesh, ascending
  };
  OpenTake& open(const std::string& take, int64_t pulse);
  bool is_removed(const OpenTake& take) const;
  /// Has the take only grown since it was opened, after `pulse`?
  static bool has_grown(const OpenTake& take, const FileStamp& mesh, int64_t pulse);

  const std::filesystem::path takes_;
  std::list<OpenTake> open_;  ///< most recently used first
};

// Converts exceptions into HTTP responses.

/// The response of `make`; 500 if it throws. The text of the exception, which may contain paths, is
/// only logged (request_error_log.h). InputError means a file that is damaged or cannot be read. It
/// is not 404, which the page takes for something that does not exist.
template <class Make>
web::WebResponse guarded_response(const Make& make) {
  try {
    return make();
  } catch (const InputError& error) {
    log_request_error(error.what());
    return web::plain_response(500, "a file cannot be read; see the log of v3d-viewd");
  } catch (const std::exception& error) {
    log_internal_error(error.what());
    return web::plain_response(500, "internal error; see the log of v3d-viewd");
  }
}

/// A response that `make` makes later, as work of this kind. `make` owns what it uses.
template <class Make>
web::WebResponse deferred_response(web::WorkKind kind, Make make) {
  return {.work = [make = std::move(make)] { return guarded_response(make); }, .kind = kind};
}

}  // namespace v3d::viewd
