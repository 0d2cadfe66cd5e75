// Fuzz target: the parsers of v3d-viewd for a request: target, range, access and command.
#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/core/text.h"
#include "daemon/viewd/command_endpoint.h"
#include "daemon/web/web_access.h"
#include "fuzz_input.h"

using v3d::test::must;

namespace {

void check(const v3d::web::WebTarget& target) {
  for (const std::string& segment : target.path) {
    must(!segment.empty() && segment != "." && segment != "..");
    must(segment.find('/') == std::string::npos && segment.find('\\') == std::string::npos);
    must(segment.find('\0') == std::string::npos && segment.find('\n') == std::string::npos);
  }
}

const std::string kOperators = "operators-token-";

const v3d::Studio& studio() {
  static const v3d::Studio kStudio = [] {
    spdlog::set_level(spdlog::level::off);
    v3d::Studio made;
    made.trigger.rate_hz = 25;
    for (const char* name : {"cam01", "cam02"}) made.cameras.emplace_back().name = name;
    return made;
  }();
  return kStudio;
}

/// The arguments of v3dctl are fixed words, or names that are not options.
void check(const v3d::viewd::OperatorCommand& command) {
  must(command.take.empty() || v3d::is_file_name(command.take));
  must(command.pulses >= 0 && command.pulses <= 86'400 * 25);
  for (const std::string& word : command.arguments()) {
    const bool option =
        word == "--json" || word == "--timeout" || word == "--pulses" || word == "--allow-missing";
    must(!word.empty() && (option || word.front() != '-'));
  }
}

void post(const v3d::web::WebRequest& request) {
  v3d::viewd::CommandEndpoint commands(studio(), kOperators);
  const v3d::web::WebResponse response = commands.post(request, v3d::MonotonicInstant());
  const auto command = commands.next_command();
  must(command.has_value() == (response.status == 202));
  if (command) check(*command);
  must(!command || request.operator_token == kOperators);
  commands.on_finished({.status = 0, .output = request.body, .errors = request.content_type});
  must(!commands.report().body.empty());
  const v3d::viewd::ParsedCommand read = v3d::viewd::parse_command(request.body, studio());
  must(read.command.has_value() == read.error.empty());
  must(read.error.find('\n') == std::string::npos);
  if (read.command) check(*read.command);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  v3d::web::WebRequest request{.method = "GET",
                               .target = input.text(),
                               .host = input.text(),
                               .origin = input.text(),
                               .range = input.text(),
                               .cookie = input.text(),
                               .authorization = input.text()};
  const int64_t file_size = input.number<uint32_t>();
  const v3d::web::ByteRange range = v3d::web::byte_range(request.range, file_size);
  must(range.first >= 0 && range.size >= 0 && range.first + range.size <= file_size);
  const auto target = v3d::web::parse_web_target(request.target);
  request.content_type = input.text();
  request.operator_token = input.text();
  request.body = input.rest();
  post(request);
  if (!target) return 0;
  check(*target);
  static const std::string kToken = "0123456789abcdef";
  const bool shown = (request.target + request.cookie + request.authorization).find("0123456") !=
                         std::string::npos ||
                     request.target.find('%') != std::string::npos;
  const bool may = v3d::web::WebAccess(kToken).check(request, *target) !=
                   v3d::web::WebAccess::Verdict::kTokenRequired;
  must(!may || shown);
  v3d::web::WebAccess("").check(request, *target);
  v3d::web::WebAccess::is_own_page(request);
  return 0;
}
