// Requests and messages of v3d-viewd, without sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "daemon/control/reply_json.h"
#include "daemon/web/web_access.h"
#include "support/child_process.h"
#include "support/open_faults.h"
#include "support/without_rights.h"
#include "viewed_site.h"

namespace v3d::viewd {
namespace {

using test::field;
using test::TemporaryFolder;
using test::ViewedSite;
using test::write;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST(WebTarget, decodes_path_and_query) {
  const auto target = web::parse_web_target("/takes/kendo-07/mesh.v3d?token=a%2Db&x");
  ASSERT_TRUE(target);
  EXPECT_THAT(target->path, ElementsAre("takes", "kendo-07", "mesh.v3d"));
  EXPECT_EQ(target->query.at("token"), "a-b");
  EXPECT_EQ(target->query.at("x"), "");
  EXPECT_TRUE(web::parse_web_target("/")->path.empty());
}

TEST(WebTarget, rejects_paths_out_of_the_folder) {
  for (const char* target :
       {"", "takes", "/..", "/takes/../../etc/passwd", "/takes/%2e%2e/x", "/takes/.", "//etc",
        "/takes//x", "/takes/", "/takes/a%2fb", "/takes/a%5cb", "/takes/a\\b", "/takes/%00", "/%",
        "/%4", "/%zz", "/\xc3\xa4", "/a%0d%0ab", "http://127.0.0.1/"}) {
    EXPECT_FALSE(web::parse_web_target(target)) << target;
  }
  EXPECT_FALSE(web::parse_web_target("/" + std::string(3000, 'a')));
  EXPECT_EQ(web::parse_web_target("/%252e%252e")->path.front(), "%2e%2e") << "decoded once only";
}

TEST(ByteRange, is_the_requested_part) {
  const auto part = [](const char* header, int64_t size) {
    const web::ByteRange range = web::byte_range(header, size);
    return std::tuple(range.kind, range.first, range.size);
  };
  using enum web::ByteRange::Kind;
  EXPECT_EQ(part("", 100), std::tuple(kWhole, 0, 100));
  EXPECT_EQ(part("bytes=0-9", 100), std::tuple(kPart, 0, 10));
  EXPECT_EQ(part("bytes=90-", 100), std::tuple(kPart, 90, 10));
  EXPECT_EQ(part("bytes=90-1000", 100), std::tuple(kPart, 90, 10));
  EXPECT_EQ(part("bytes=-24", 100), std::tuple(kPart, 76, 24));
  EXPECT_EQ(part("bytes=-1000", 100), std::tuple(kPart, 0, 100));
  EXPECT_EQ(std::get<0>(part("bytes=100-", 100)), kUnsatisfiable);
  EXPECT_EQ(std::get<0>(part("bytes=-0", 100)), kUnsatisfiable);
  EXPECT_EQ(std::get<0>(part("bytes=0-", 0)), kUnsatisfiable);
  for (const char* odd : {"bytes=0-1,3-4", "lines=0-9", "bytes=", "bytes=-", "bytes=9-1",
                          "bytes=a-b", "bytes=--5", "bytes=99999999999999999999-"}) {
    EXPECT_EQ(std::get<0>(part(odd, 100)), kWhole) << odd;
  }
}

RC_GTEST_PROP(ByteRange, lies_inside_the_file_for_any_request, (int64_t first, int64_t last)) {
  const int64_t size = *rc::gen::inRange<int64_t>(0, 1000);
  const web::ByteRange range =
      web::byte_range("bytes=" + std::to_string(first) + "-" + std::to_string(last), size);
  RC_ASSERT(range.first >= 0 && range.size >= 0 && range.first + range.size <= size);
}

TEST(WebAddress, is_an_ip_address_and_a_port) {
  EXPECT_TRUE(web::parse_web_address("127.0.0.1:8330", "f").is_loopback());
  EXPECT_TRUE(web::parse_web_address("[::1]:8330", "f").is_loopback());
  EXPECT_FALSE(web::parse_web_address("0.0.0.0:8330", "f").is_loopback());
  EXPECT_EQ(web::parse_web_address("[::]:1", "f").host, "::");
  for (const char* odd :
       {"", "8330", "localhost:8330", "127.0.0.1", "127.0.0.1:", "1.2.3.4:70000", "1.2.3.4:1x"}) {
    EXPECT_THROW(web::parse_web_address(odd, "f"), InputError) << odd;
  }
}

class WebToken : public testing::Test {
 protected:
  void save(const std::string& text, mode_t mode) {
    write(path_, text);
    chmod(path_.c_str(), mode);
  }
  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "viewer.token";
};

TEST_F(WebToken, is_one_line_with_restricted_permissions) {
  EXPECT_THROW(web::load_web_token(path_, "f"), InputError) << "there is none";
  save("0123456789abcdef\n", 0640);
  EXPECT_EQ(web::load_web_token(path_, "f"), "0123456789abcdef");
  save("0123456789abcdef\n", 0644);
  EXPECT_THROW(web::load_web_token(path_, "f"), InputError) << "others may read it";
  save("0123456789abcdef\n", 0660);
  EXPECT_THROW(web::load_web_token(path_, "f"), InputError) << "its group may change it";
  for (const char* odd : {"", "short\n", "0123456789 abcdef\n", "0123456789abcdef\nanother\n"}) {
    save(odd, 0600);
    EXPECT_THROW(web::load_web_token(path_, "f"), InputError) << odd;
  }
}

web::WebAccess::Verdict check(const web::WebAccess& access, const web::WebRequest& request) {
  return access.check(request, *web::parse_web_target(request.target));
}

TEST(WebAccess, without_a_token_allows_only_names_of_this_pc) {
  const web::WebAccess access("");
  for (const char* host : {"127.0.0.1:8330", "localhost:8330", "[::1]:8330", "127.0.0.1"}) {
    EXPECT_EQ(check(access, {.target = "/", .host = host}), web::WebAccess::Verdict::kAllowed)
        << host;
  }
  for (const char* host : {"", "evil.example", "127.0.0.1.evil.example:8330", "10.0.0.1:8330"}) {
    EXPECT_EQ(check(access, {.target = "/", .host = host}), web::WebAccess::Verdict::kForeignHost)
        << host;
  }
}

TEST(WebAccess, with_a_token_allows_only_requests_with_the_token) {
  const web::WebAccess access("0123456789abcdef");
  using enum web::WebAccess::Verdict;
  EXPECT_EQ(check(access, {.target = "/", .host = "127.0.0.1"}), kTokenRequired);
  EXPECT_EQ(check(access, {.target = "/?token=0123456789abcdef"}), kAllowedWithCookie);
  EXPECT_EQ(check(access, {.target = "/?token=0123456789abcdeX"}), kTokenRequired);
  EXPECT_EQ(check(access, {.target = "/?token="}), kTokenRequired);
  EXPECT_EQ(check(access, {.target = "/", .authorization = "Bearer 0123456789abcdef"}), kAllowed);
  EXPECT_EQ(check(access, {.target = "/", .cookie = "a=b; v3d_token=0123456789abcdef"}), kAllowed);
  for (const char* cookie : {"v3d_token=", "v3d_token=0123456789abcde",
                             "xv3d_token=0123456789abcdef", "v3d_token=0123456789abcdef0"}) {
    EXPECT_EQ(check(access, {.target = "/", .cookie = cookie}), kTokenRequired) << cookie;
  }
}

/// A browser sends the cookies of a host to all its ports.
TEST(WebAccess, allows_a_browser_that_uses_two_studios_behind_one_host_name) {
  const web::WebAccess a("0123456789abcdef"), b("fedcba9876543210");
  const auto set_by = [](const web::WebAccess& access) {
    const std::string cookie = access.set_cookie();
    return cookie.substr(0, cookie.find(';'));
  };
  const auto name_in = [](const std::string& cookie) { return cookie.substr(0, cookie.find('=')); };
  EXPECT_NE(name_in(set_by(a)), name_in(set_by(b))) << "one would replace the other";
  const web::WebRequest request{.target = "/", .cookie = set_by(a) + "; " + set_by(b)};
  EXPECT_EQ(check(a, request), web::WebAccess::Verdict::kAllowed);
  EXPECT_EQ(check(b, request), web::WebAccess::Verdict::kAllowed);
  EXPECT_EQ(check(b, {.target = "/", .cookie = set_by(a)}),
            web::WebAccess::Verdict::kTokenRequired);
}

TEST_F(ViewedSite, serves_only_files_of_the_page) {
  EXPECT_EQ(get("/").type, "text/html; charset=utf-8");
  EXPECT_THAT(field(get("/assets/a.js"), "Cache-Control"), HasSubstr("immutable"));
  EXPECT_EQ(get("/assets").status, 404);
  EXPECT_EQ(get("/outside").status, 404);
  EXPECT_EQ(get("/../outside").status, 400);
  std::filesystem::create_symlink(folder_ / "outside", folder_ / "page/link");
  EXPECT_EQ(get("/link").status, 404) << "links are not followed";
}

TEST_F(ViewedSite, serves_requested_parts_of_a_mesh_file) {
  const web::WebResponse whole = get("/takes/kendo-07/mesh.v3d");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.file->size, 10);
  const web::WebResponse part = get("/takes/kendo-07/mesh.v3d", "bytes=2-4");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(field(part, "Content-Range"), "bytes 2-4/10");
  EXPECT_EQ(part.file->first, 2);
  EXPECT_EQ(part.file->size, 3);
  EXPECT_EQ(get("/takes/kendo-07/mesh.v3d", "bytes=10-").status, 416);
}

TEST_F(ViewedSite, serves_the_whole_file_to_a_download_that_resumes_after_the_file_was_replaced) {
  WebSite site = this->site();
  web::WebRequest request{.method = "GET",
                          .target = "/takes/kendo-07/mesh.v3d",
                          .host = "localhost",
                          .range = "bytes=2-"};
  const std::string tag = field(done(site.respond(request)), "ETag");
  request.if_range = tag;
  EXPECT_EQ(done(site.respond(request)).status, 206);
  write(folder_ / "takes/kendo-07/mesh.v3d", "another mesh file");
  for (const std::string& before : {tag, std::string("Mon, 30 Nov 2026 03:00:00 GMT")}) {
    request.if_range = before;
    const web::WebResponse response = done(site.respond(request));
    EXPECT_EQ(response.status, 200) << before;
    EXPECT_EQ(response.file->first, 0);
    EXPECT_EQ(response.file->size, 17);
  }
}

TEST_F(ViewedSite, serves_requested_parts_of_a_proxy_and_of_a_motion_file) {
  for (const std::string name : {"proxy.v3d", "motion.v3d"}) {
    EXPECT_EQ(get("/takes/kendo-07/" + name).status, 404) << "the take has none";
    write(folder_ / "takes/kendo-07" / name, "0123456");
    EXPECT_EQ(get("/takes/kendo-07/" + name).file->size, 7);
    const web::WebResponse part = get("/takes/kendo-07/" + name, "bytes=2-4");
    EXPECT_EQ(part.status, 206);
    EXPECT_EQ(field(part, "Content-Range"), "bytes 2-4/7");
    EXPECT_EQ(get("/takes/kendo-07/" + name, "bytes=7-").status, 416);
  }
}

TEST_F(ViewedSite, serves_the_skeletons_of_performers_and_the_operations_of_an_edited_take) {
  for (const std::string name : {"skeleton.json", "skeleton.performer2.json", "edit.json"}) {
    EXPECT_EQ(get("/takes/kendo-07/" + name).status, 404);
    write(folder_ / "takes/kendo-07" / name, "{}");
    const web::WebResponse response = get("/takes/kendo-07/" + name);
    EXPECT_EQ(response.status, 200);
    EXPECT_EQ(response.type, "application/json") << name;
  }
  for (const std::string name : {"skeleton.performer.json", "skeleton.performer2x.json",
                                 "skeleton.performer2.json.bak", "skeleton.performer2222.json"}) {
    write(folder_ / "takes/kendo-07" / name, "{}");
    EXPECT_EQ(get("/takes/kendo-07/" + name).status, 404) << name;
  }
}

TEST_F(ViewedSite, lists_the_performers_with_a_skeleton_although_some_between_have_none) {
  const std::string listing = "/api/takes/kendo-07/skeletons";
  EXPECT_EQ(get(listing).body, R"({"performers":[]})");
  for (const char* file : {"skeleton.json", "skeleton.performer3.json", "skeleton.performer12.json",
                           "skeleton.performer1.json", "skeleton.performer999.json"}) {
    write(folder_ / "takes/kendo-07" / file, "{}");
  }
  EXPECT_EQ(get(listing).body, R"({"performers":[1,3,12]})");
  EXPECT_EQ(get("/api/takes/none/skeletons").body, R"({"performers":[]})");
}

TEST_F(ViewedSite, answers_304_for_an_unchanged_file) {
  WebSite site = this->site();
  web::WebRequest request{
      .method = "GET", .target = "/takes/kendo-07/mesh.v3d", .host = "localhost"};
  request.if_none_match = field(done(site.respond(request)), "ETag");
  EXPECT_EQ(done(site.respond(request)).status, 304);
  write(folder_ / "takes/kendo-07/mesh.v3d", "01234567890");
  EXPECT_EQ(done(site.respond(request)).status, 200);
}

TEST_F(ViewedSite, serves_no_other_file_of_a_take_and_follows_no_link) {
  for (const char* target :
       {"/takes/kendo-07/studio.toml", "/takes/kendo-07/cam01.lcmlog", "/takes/none/mesh.v3d",
        "/takes/kendo-07/%2e%2e/outside", "/takes/-x/mesh.v3d", "/takes/kendo-07"}) {
    EXPECT_THAT(get(target).status, testing::AnyOf(404, 400)) << target;
  }
  std::filesystem::create_symlink(folder_ / "outside", folder_ / "takes/kendo-07/motion.v3d");
  EXPECT_EQ(get("/takes/kendo-07/motion.v3d").status, 404);
  std::filesystem::remove(folder_ / "takes/kendo-07/mesh.v3d");
  std::filesystem::create_symlink(folder_ / "outside", folder_ / "takes/kendo-07/mesh.v3d");
  EXPECT_EQ(get("/takes/kendo-07/mesh.v3d").status, 404);
  std::filesystem::remove(folder_ / "takes/kendo-07/mesh.v3d");
  std::filesystem::create_directory(folder_ / "takes/kendo-07/mesh.v3d");
  EXPECT_EQ(get("/takes/kendo-07/mesh.v3d").status, 404);
}

TEST_F(ViewedSite, answers_503_for_a_file_when_it_has_no_free_descriptor) {
  WebSite site = this->site();
  const web::WebRequest request{
      .method = "GET", .target = "/takes/kendo-07/mesh.v3d", .host = "localhost"};
  const auto status = [&] { return done(site.respond(request)).status; };
  const auto status_without_descriptor = [&] {
    const test::NoDescriptorsLeft none;
    return status();
  };
  EXPECT_EQ(status_without_descriptor(), 503);
  EXPECT_EQ(status(), 200);
}

TEST_F(ViewedSite, serves_a_scene_and_its_files) {
  write(folder_ / "takes/duel/scene.json", "{}");
  write(folder_ / "takes/duel/temple.glb", "glTF");
  write(folder_ / "takes/duel/notes.txt", "secret");
  write(folder_ / "takes/kendo-07/cam01.png", "secret");
  EXPECT_EQ(get("/api/scenes").body, R"({"scenes":["duel"]})");
  EXPECT_EQ(get("/takes/duel/scene.json").type, "application/json");
  EXPECT_EQ(get("/takes/duel/temple.glb").type, "model/gltf-binary");
  EXPECT_EQ(get("/takes/duel/notes.txt").status, 404);
  EXPECT_EQ(get("/takes/kendo-07/cam01.png").status, 404) << "that folder holds no scene";
  std::filesystem::create_symlink(folder_ / "outside", folder_ / "takes/duel/sky.png");
  EXPECT_EQ(get("/takes/duel/sky.png").status, 404) << "links are not followed";
}

TEST_F(ViewedSite, reveals_no_path_when_a_file_is_missing) {
  for (const char* target : {"/api/rig", "/api/takes/none/rig"}) {
    const web::WebResponse response = get(target);
    EXPECT_EQ(response.status, 404);
    EXPECT_THAT(response.body, Not(HasSubstr(folder_.path().string())));
  }
  EXPECT_EQ(get("/api/takes").body, R"({"takes":[]})") << "folders that are not takes are ignored";
}

TEST_F(ViewedSite, does_not_report_a_damaged_calibration_or_ledger_as_missing) {
  const std::string take = "/api/takes/kendo-07/";
  for (const std::string& target : {std::string("/api/rig"), take + "rig", take + "sound"}) {
    EXPECT_EQ(get(target).status, 404) << target << ": there is none";
  }
  write(folder_ / "calib.toml", "broken = [");
  write(folder_ / "takes/kendo-07/calib.toml", "broken = [");
  write(folder_ / "takes/kendo-07/ledger.toml", "x");
  for (const std::string& target : {std::string("/api/rig"), take + "rig", take + "sound"}) {
    const web::WebResponse response = get(target);
    EXPECT_EQ(response.status, 500) << target;
    EXPECT_THAT(response.body, HasSubstr("cannot be read"));
    EXPECT_THAT(response.body, Not(HasSubstr(folder_.path().string())));
  }
}

TEST_F(ViewedSite, does_not_report_a_file_as_missing_that_it_may_not_read) {
  std::filesystem::permissions(folder_.path(), std::filesystem::perms(0755));
  for (const char* name : {"mesh.v3d", "motion.v3d"}) {
    const std::filesystem::path file = folder_ / "takes/kendo-07" / name;
    write(file, "0123456789");
    std::filesystem::permissions(file, std::filesystem::perms::none);
    const test::WithoutRights rights;
    if (!rights.is_set()) GTEST_SKIP() << "skipped: this system does not permit another user";
    EXPECT_EQ(get("/takes/kendo-07/" + std::string(name)).status, 500);
  }
}

TEST_F(ViewedSite, lists_a_take_of_which_a_file_has_a_typing_error) {
  save_info({"cam01"});
  write(folder_ / "takes/kendo-07/slate.toml", "scene = '12'\nmark = 'circle'\n");
  nlohmann::json take = nlohmann::json::parse(get("/api/takes").body)["takes"][0];
  EXPECT_EQ(take["name"], "kendo-07");
  EXPECT_EQ(take["pulses"], 3);
  EXPECT_THAT(take["error"].get<std::string>(),
              testing::AllOf(testing::StartsWith("slate.toml"), HasSubstr("circled")));
  write(folder_ / "takes/kendo-07/slate.toml", "scene = '12'\n");
  write(folder_ / "takes/kendo-07/take.toml", "name = \"kendo-07\n");
  take = nlohmann::json::parse(get("/api/takes").body)["takes"][0];
  EXPECT_EQ(take["name"], "kendo-07");
  EXPECT_EQ(take["slate"]["scene"], "12");
  EXPECT_EQ(take["state"], "incomplete");
  EXPECT_THAT(take["error"].get<std::string>(), HasSubstr("take.toml"));
  EXPECT_THAT(take.dump(), Not(HasSubstr(folder_.path().string())));
}

TEST_F(ViewedSite, lists_a_copied_take_by_the_name_of_its_folder) {
  save_info({"cam01"});
  std::filesystem::create_directory(folder_ / "takes/kendo-07-copy");
  std::filesystem::copy_file(folder_ / "takes/kendo-07/take.toml",
                             folder_ / "takes/kendo-07-copy/take.toml");
  std::vector<std::string> names;
  const nlohmann::json listing = nlohmann::json::parse(get("/api/takes").body);
  for (const auto& take : listing["takes"]) names.push_back(take["name"]);
  EXPECT_THAT(names, testing::UnorderedElementsAre("kendo-07", "kendo-07-copy"));
}

TEST_F(ViewedSite, logs_once_why_a_file_of_a_take_cannot_be_read) {
  save_info({"cam01"});
  write(folder_ / "takes/kendo-07/slate.toml", "mark = 'circle'\n");
  int listings = 0;
  WebSite site(studio_, web::WebAccess(""), find_page_files(folder_ / "page"), commands_,
               [&, list = WebSite::make_list_takes()](const std::filesystem::path& folder) {
                 ++listings;
                 return list(folder);
               });
  const auto has_listed_twice = [&] {
    done(site.respond({.method = "GET", .target = "/api/takes", .host = "localhost"}));
    return listings >= 2;
  };
  testing::internal::CaptureStdout();
  EXPECT_TRUE(test::becomes_true(has_listed_twice, test::within(20)));
  const std::string log = testing::internal::GetCapturedStdout();
  const std::string line = "take kendo-07: slate.toml";
  EXPECT_THAT(log, HasSubstr(line));
  EXPECT_EQ(log.find(line), log.rfind(line)) << log;
}

TEST_F(ViewedSite, accepts_only_get_and_head) {
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", ""}) {
    const web::WebResponse response =
        site().respond({.method = method, .target = "/api/takes", .host = "localhost"});
    EXPECT_EQ(response.status, 405) << method;
  }
}

TEST_F(ViewedSite, rejects_a_host_field_with_user_information) {
  for (const char* host :
       {"localhost@evil.example", "evil.example@localhost", "a:b@127.0.0.1:8330", "local host"}) {
    const web::WebResponse response =
        site().respond({.method = "GET", .target = "/", .host = host});
    EXPECT_EQ(response.status, 400) << host;
    EXPECT_THAT(response.body, testing::StartsWith("Host: ")) << host;
    EXPECT_EQ(std::ranges::count(response.body, '\n'), 1) << "one line";
  }
}

TEST_F(ViewedSite, rejects_several_host_fields) {
  const web::WebResponse response = site().respond(
      {.method = "GET", .target = "/", .host = "localhost", .has_several_hosts = true});
  EXPECT_EQ(response.status, 400);
  EXPECT_THAT(response.body, testing::StartsWith("Host: "));
}

TEST_F(ViewedSite, opens_streams_to_its_own_page_only) {
  web::WebRequest request{.method = "GET",
                          .target = "/api/live",
                          .host = "127.0.0.1:8330",
                          .origin = "http://127.0.0.1:8330"};
  EXPECT_EQ(site().open_stream(request).stream, WebSite::StreamKind::kLive);
  request.origin = "http://evil.example";
  EXPECT_EQ(site().open_stream(request).refusal.status, 403);
  request.origin = "";
  EXPECT_TRUE(site().open_stream(request).stream) << "no browser";
  request.target = "/api/other";
  EXPECT_EQ(site().open_stream(request).refusal.status, 404);
  request.host = "evil.example";
  EXPECT_EQ(site().open_stream(request).refusal.status, 403);
}

TEST(TakesJson, replaces_bytes_of_a_slate_that_are_not_utf8) {
  take::TakeListing take;
  take.info.rate_hz = 25;
  take.slate.note = "caf\xe9";
  EXPECT_NE(control::takes_json({take}).find("caf\xEF\xBF\xBD"), std::string::npos);
}

}  // namespace
}  // namespace v3d::viewd
