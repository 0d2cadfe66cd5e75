// The viewd::WebSite of a studio with one take, without sockets.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "daemon/viewd/web_site.h"
#include "support/temporary_folder.h"
#include "take/take.h"

namespace v3d::test {

inline void write(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

inline std::string field(const web::WebResponse& response, const std::string& name) {
  for (const auto& [known, value] : response.fields) {
    if (known == name) return value;
  }
  return "";
}

/// The files of `folder` that this process has open; removed ones end in " (deleted)".
inline std::vector<std::string> open_files_in(const std::filesystem::path& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code closed;
    const std::string file = std::filesystem::read_symlink(entry, closed);
    if (file.starts_with(folder.string())) files.push_back(file);
  }
  return files;
}

class ViewedSite : public testing::Test {
 protected:
  ViewedSite() {
    write(folder_ / "page/index.html", "<!doctype html>");
    write(folder_ / "page/assets/a.js", "let a");
    write(folder_ / "takes/kendo-07/mesh.v3d", "0123456789");
    write(folder_ / "takes/kendo-07/studio.toml", "secret");
    write(folder_ / "outside", "secret");
    studio_.storage.takes = folder_ / "takes";
    studio_.storage.calib = folder_ / "calib.toml";
  }

  web::WebResponse get(const std::string& target, const std::string& range = "") {
    return done(site().respond(
        {.method = "GET", .target = target, .host = "127.0.0.1:8330", .range = range}));
  }
  /// The final response, after deferred work.
  static web::WebResponse done(web::WebResponse response) {
    return response.work ? response.work() : response;
  }
  viewd::WebSite site() {
    return {studio_, web::WebAccess(""), viewd::find_page_files(folder_ / "page"), commands_};
  }

  /// Writes the take.toml of kendo-07: a complete take of three pulses.
  void save_info(const std::vector<std::string>& cameras) const {
    io::throw_if_failed(save_take_info(take::TakePaths{folder_ / "takes/kendo-07"},
                                       {.name = "kendo-07",
                                        .studio = "dojo",
                                        .rate_hz = 25,
                                        .pulses = 3,
                                        .state = take::TakeState::kComplete,
                                        .software_version = "test",
                                        .started = Realtime::now(),
                                        .cameras = cameras}));
  }

  const TemporaryFolder folder_;
  Studio studio_;
  viewd::CommandEndpoint commands_{studio_, ""};
};

}  // namespace v3d::test
