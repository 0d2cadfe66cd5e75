#include "daemon/viewd/web_site.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include "base/config/calib_file.h"
#include "base/core/bytes.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/core/time.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "daemon/control/reply_json.h"
#include "daemon/viewd/served_files.h"
#include "daemon/viewd/take_pictures.h"
#include "daemon/viewd/view_json.h"
#include "daemon/web/web_access.h"
#include "take/ledger/ledger.h"
#include "take/take_listing.h"

namespace v3d::viewd {
namespace {

/// The response where a file cannot be opened, by errno: 404 only when there is no such file or it
/// is a link or a socket, 503 when a later attempt may succeed. Throws InputError for other errors.
web::WebResponse unopened_response(int error, const std::filesystem::path& path) {
  if (error == ENOENT || error == ENOTDIR || error == ELOOP || error == ENXIO) {
    return web::plain_response(404, "there is no such file");
  }
  if (error != EMFILE && error != ENFILE && error != ENOMEM) {
    errno = error;
    throw InputError(errno_message(path.string()));
  }
  web::WebResponse response = web::plain_response(503, "too many open files; try again");
  response.fields = {{"Retry-After", "1"}};
  return response;
}

/// A regular file, or the requested part of it. Links are not followed.
web::WebResponse file_response(const web::WebRequest& request, const std::filesystem::path& path,
                               web::WorkKind kind) {
  io::UniqueFd opened(io::uninterrupted(
      [&] { return ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK); }));
  if (!opened) return unopened_response(errno, path);
  const auto file = std::make_shared<const io::UniqueFd>(std::move(opened));
  struct stat state {};
  if (fstat(file->get(), &state) != 0) return unopened_response(errno, path);
  if (!S_ISREG(state.st_mode)) return web::plain_response(404, "not a regular file");
  web::WebResponse response{.type = content_type(path)};
  const std::string tag = tag_of(stamp_of(state));
  response.fields = {{"ETag", tag}, {"Accept-Ranges", "bytes"}};
  if (request.if_none_match == tag) {
    response.status = 304;
    return response;
  }
  // The rest of another file would make a mixture: RFC 9110, section 13.1.5.
  const bool is_of_other_file = !request.if_range.empty() && request.if_range != tag;
  const web::ByteRange range =
      web::byte_range(is_of_other_file ? "" : request.range, state.st_size);
  const std::string all = std::to_string(state.st_size);
  if (range.kind == web::ByteRange::Kind::kUnsatisfiable) {
    response.status = 416;
    response.fields.emplace_back("Content-Range", "bytes */" + all);
    return response;
  }
  if (range.kind == web::ByteRange::Kind::kPart) {
    response.status = 206;
    response.fields.emplace_back("Content-Range", "bytes " + std::to_string(range.first) + "-" +
                                                      std::to_string(range.first + range.size - 1) +
                                                      "/" + all);
  }
  response.file =
      web::FilePart{.file = file, .first = range.first, .size = range.size, .kind = kind};
  return response;
}

/// Files below assets/ may be cached for ever, because their names change with their content.
web::WebResponse page_response(const web::WebRequest& request, const web::WebTarget& target,
                               const PageFile& page) {
  const bool is_immutable = !target.path.empty() && target.path.front() == "assets";
  return deferred_response(web::WorkKind::kPage, [request, page, is_immutable] {
    web::WebResponse response = file_response(request, page.path, web::WorkKind::kPage);
    response.type = page.type;
    response.fields.emplace_back("Cache-Control",
                                 is_immutable ? "public, max-age=31536000, immutable" : "no-cache");
    return response;
  });
}

/// Throws InputError where this is unknown.
bool is_there(const std::filesystem::path& path) {
  return io::value_or_throw(io::type_of(path)) != std::filesystem::file_type::not_found;
}

/// `load` reads the calibration `file`.
web::WebResponse rig_response(const std::filesystem::path& file, std::function<Rig()> load) {
  return deferred_response(web::WorkKind::kFile, [file, load = std::move(load)] {
    if (!is_there(file)) return web::plain_response(404, "there is no calibration");
    return web::json_response(rig_json(load()));
  });
}

web::WebResponse redirect_with_cookie(const web::WebTarget& target, const std::string& cookie) {
  web::WebResponse response = web::plain_response(303, "");
  response.fields = {{"Location", target.text()}, {"Set-Cookie", cookie}};
  return response;
}

bool is_command(const web::WebRequest& request, const std::optional<web::WebTarget>& target) {
  return request.method == "POST" && target && target->text() == "/api/order";
}

/// skeleton.performerK.json, as v3dctl skeleton --performer K writes it.
bool is_skeleton_of_performer(std::string_view file) {
  constexpr std::string_view kBegin = "skeleton.performer", kEnd = ".json";
  if (!file.starts_with(kBegin) || !file.ends_with(kEnd)) return false;
  file.remove_prefix(kBegin.size());
  file.remove_suffix(kEnd.size());
  return !file.empty() && file.size() <= 3 &&
         std::ranges::all_of(file, [](char c) { return c >= '0' && c <= '9'; });
}

bool is_served(const std::string& file) {
  constexpr std::array kFiles{"mesh.v3d",   "proxy.v3d",     "motion.v3d",
                              "calib.toml", "skeleton.json", "edit.json"};
  return std::ranges::find(kFiles, file) != kFiles.end() || is_skeleton_of_performer(file);
}

}  // namespace

/// Response with the JSON of a listing. It is made again by a request if the last one is older than
/// kMaxAge. Used by one thread at a time.
class WebSite::CachedListing {
 public:
  explicit CachedListing(std::function<std::string()> list) : list_(std::move(list)) {}

  web::WebResponse make_response() {
    const MonotonicInstant now = Monotonic::now();
    if (!listed_ || now - *listed_ > kMaxAge) {
      json_ = list_();
      listed_ = Monotonic::now();
    }
    web::WebResponse response = web::json_response(json_);
    response.fields = {{"ETag", text_tag(json_)}, {"Cache-Control", "no-cache"}};
    return response;
  }

  static web::WebResponse respond(const std::string& name,
                                  const std::shared_ptr<CachedListing>& listing) {
    return {
        .work = [listing] { return guarded_response([&] { return listing->make_response(); }); },
        .kind = web::WorkKind::kListing,
        .listing = name};
  }

 private:
  static constexpr Duration kMaxAge = std::chrono::seconds(1);

  static std::string text_tag(const std::string& text) {
    const uint64_t sum =
        checksum({std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size())});
    return "\"" + std::to_string(sum) + "\"";
  }

  const std::function<std::string()> list_;
  std::string json_;
  std::optional<MonotonicInstant> listed_;
};

namespace {

/// "/takes/kendo-07/slate.toml:2: ..." becomes "slate.toml:2: ...", as browsers get no paths.
std::string error_for_browsers(const take::TakeListing& take) {
  std::string text = take.error;
  if (text.empty()) return text;
  const std::string folder = take.paths.folder.string() + "/";
  for (size_t at = text.find(folder); at != std::string::npos; at = text.find(folder)) {
    text.erase(at, folder.size());
  }
  const bool has_path = text.find(take.paths.folder.parent_path().string()) != std::string::npos;
  return has_path ? "a file of the take cannot be read; v3dctl takes names the cause" : text;
}

/// Logs the error of each take once, until it has another one.
class TakeErrorLog {
 public:
  void log(const std::vector<take::TakeListing>& takes) {
    std::set<std::string> lines;
    for (const take::TakeListing& take : takes) {
      if (!take.error.empty()) lines.insert("take " + take.info.name + ": " + take.error);
    }
    for (const std::string& line : lines) {
      if (!logged_.contains(line)) spdlog::warn("{}", line);
    }
    logged_ = std::move(lines);
  }

 private:
  std::set<std::string> logged_;
};

}  // namespace

WebSite::ListTakes WebSite::make_list_takes() {
  return [cache = std::make_shared<take::TakeListingCache>()](const std::filesystem::path& folder) {
    std::vector<take::TakeListing> takes = cache->find_all_takes(folder);
    if (takes.size() > kMaxListed) takes.erase(takes.begin(), takes.end() - kMaxListed);
    for (take::TakeListing& take : takes) {
      take.info.name = take.paths.folder.filename();  // as in the paths of requests
      take.error = error_for_browsers(take);
      if (!take.meshes) take.mesh_error = "mesh.v3d cannot be read; v3dctl takes names the cause";
    }
    return takes;
  };
}

WebSite::WebSite(const Studio& studio, web::WebAccess access, std::map<std::string, PageFile> page,
                 CommandEndpoint& commands, const ListTakes& list)
    : takes_(studio.storage.takes),
      calib_(studio.storage.calib),
      access_(std::move(access)),
      page_(std::move(page)),
      commands_(commands),
      pictures_(takes_),
      take_listing_(std::make_shared<CachedListing>(
          [list, takes = takes_, errors = std::make_shared<TakeErrorLog>()] {
            const std::vector<take::TakeListing> found = list(takes);
            errors->log(found);
            return control::takes_json(found);
          })),
      scene_listing_(std::make_shared<CachedListing>(
          [takes = takes_] { return scenes_json(find_scenes(takes)); })) {}

web::ClientRole WebSite::role_of(const web::WebRequest& request) const {
  const auto target = web::parse_web_target(request.target);
  if (!target || !web::WebAccess::host_error(request).empty())
    return web::ClientRole::kUnauthenticated;
  const web::WebAccess::Verdict verdict = access_.check(request, *target);
  if (verdict == web::WebAccess::Verdict::kTokenRequired ||
      verdict == web::WebAccess::Verdict::kForeignHost) {
    return web::ClientRole::kUnauthenticated;
  }
  return commands_.is_operator(request) ? web::ClientRole::kOperator : web::ClientRole::kViewer;
}

std::optional<web::WebResponse> WebSite::refusal(
    const web::WebRequest& request, const std::optional<web::WebTarget>& target) const {
  if (const std::string wrong = web::WebAccess::host_error(request); !wrong.empty()) {
    return web::plain_response(400, wrong);
  }
  if (request.method != "GET" && request.method != "HEAD" && !is_command(request, target)) {
    web::WebResponse response = web::plain_response(405, "only GET and HEAD are answered");
    response.fields = {{"Allow", "GET, HEAD"}};
    return response;
  }
  if (!target) return web::plain_response(400, "not a valid path");
  switch (access_.check(request, *target)) {
    case web::WebAccess::Verdict::kAllowed:
      return {};
    case web::WebAccess::Verdict::kAllowedWithCookie:
      return redirect_with_cookie(*target, access_.set_cookie());
    case web::WebAccess::Verdict::kForeignHost:
      return web::plain_response(403, "this server answers to localhost and 127.0.0.1 only");
    case web::WebAccess::Verdict::kTokenRequired:
      break;
  }
  web::WebResponse response = web::plain_response(
      401, "This studio requires a token: open this address with ?token=TOKEN appended, once.");
  response.fields = {{"WWW-Authenticate", "Bearer"}};
  return response;
}

web::WebResponse WebSite::respond(const web::WebRequest& request) {
  return guarded_response([&]() -> web::WebResponse {
    const auto target = web::parse_web_target(request.target);
    if (auto refused = refusal(request, target)) return std::move(*refused);
    if (is_command(request, target)) return commands_.post(request, Monotonic::now());
    return find(request, *target);
  });
}

// --- the server's interface ----------------------------------------------------------------------

web::WebHandler::Opening SiteHandler::open_stream(const web::WebRequest& request) {
  WebSite::Opening opening = site_.open_stream(request);
  if (!opening.stream) return {nullptr, std::move(opening.refusal)};
  return {subscribe_(*opening.stream), {}};
}

WebSite::Opening WebSite::open_stream(const web::WebRequest& request) const {
  const auto target = web::parse_web_target(request.target);
  if (auto refused = refusal(request, target)) return {{}, std::move(*refused)};
  if (!web::WebAccess::is_own_page(request))
    return {{}, web::plain_response(403, "WebSockets of pages of other origins are refused")};
  if (target->text() == "/api/live") return {StreamKind::kLive, {}};
  if (target->text() == "/api/studio") return {StreamKind::kStudio, {}};
  return {{}, web::plain_response(404, "there is no such stream")};
}

web::WebResponse WebSite::find(const web::WebRequest& request, const web::WebTarget& target) const {
  const std::vector<std::string>& path = target.path;
  if (target.text() == "/api/takes") return CachedListing::respond("takes", take_listing_);
  if (target.text() == "/api/scenes") return CachedListing::respond("scenes", scene_listing_);
  if (target.text() == "/api/order") return commands_.report();
  if (target.text() == "/api/rig")
    return rig_response(calib_, [calib = calib_] { return load_calib(calib); });
  if (path.size() == 4 && path[0] == "api" && path[1] == "takes" && path[3] == "rig") {
    if (!is_file_name(path[2])) return web::plain_response(404, "there is no such take");
    const take::TakePaths take{takes_ / path[2]};
    return rig_response(take.calib(), [take] { return load_take_calib(take); });
  }
  if (path.size() == 4 && path[0] == "api" && path[1] == "takes" && path[3] == "sound") {
    return take_sound(path[2]);
  }
  if (path.size() == 4 && path[0] == "api" && path[1] == "takes" && path[3] == "skeletons") {
    return take_skeletons(path[2]);
  }
  if (path.size() == 4 && path[0] == "takes" && path[2] == "sound") {
    return sound_file(request, path[1], path[3]);
  }
  if (auto pictures = pictures_.respond(request, target)) return std::move(*pictures);
  if (path.size() == 3 && path[0] == "takes") return take_file(request, path[1], path[2]);
  const auto page = page_.find(target.text());
  if (page == page_.end()) return web::plain_response(404, "there is no such page");
  return page_response(request, target, page->second);
}

web::WebResponse WebSite::take_file(const web::WebRequest& request, const std::string& take,
                                    const std::string& file) const {
  const web::WebResponse unknown = web::plain_response(404, "there is no such file of a take");
  if (!is_file_name(take) || !is_file_name(file)) return unknown;
  return deferred_response(web::WorkKind::kFile, [request, folder = takes_ / take, file, unknown] {
    if (!is_served(file) && !is_of_scene(folder, file)) return unknown;
    web::WebResponse response = file_response(request, folder / file, web::WorkKind::kFile);
    response.fields.emplace_back("Cache-Control", "no-cache");
    return response;
  });
}

web::WebResponse WebSite::take_skeletons(const std::string& take) const {
  if (!is_file_name(take)) return web::plain_response(404, "there is no such take");
  return deferred_response(web::WorkKind::kFile, [folder = takes_ / take] {
    return web::json_response(skeletons_json(find_skeletons(folder)));
  });
}

web::WebResponse WebSite::take_sound(const std::string& take) const {
  if (!is_file_name(take)) return web::plain_response(404, "there is no such take");
  return deferred_response(web::WorkKind::kFile, [paths = take::TakePaths{takes_ / take}] {
    if (!is_there(paths.ledger())) return web::plain_response(404, "the take has no ledger");
    const take::Ledger ledger = take::load_ledger(paths.ledger());
    const auto studio = ledger.sounds.empty() ? std::nullopt : load_take_studio(paths);
    return web::json_response(sound_json(ledger.sounds, studio));
  });
}

web::WebResponse WebSite::sound_file(const web::WebRequest& request, const std::string& take,
                                     const std::string& file) const {
  const web::WebResponse unknown = web::plain_response(404, "there is no such file of a take");
  if (!is_file_name(take) || !is_file_name(file) || !file.ends_with(".wav")) return unknown;
  return deferred_response(
      web::WorkKind::kFile, [request, folder = takes_ / take / "sound", file, unknown] {
        const auto type = io::value_or_throw(io::entry_type_of(folder));
        if (type != std::filesystem::file_type::directory) return unknown;
        web::WebResponse response = file_response(request, folder / file, web::WorkKind::kFile);
        response.fields.emplace_back("Cache-Control", "no-cache");
        return response;
      });
}

}  // namespace v3d::viewd
