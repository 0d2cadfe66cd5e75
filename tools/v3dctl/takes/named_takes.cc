#include "v3dctl/takes/named_takes.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "daemon/control/reply_json.h"

namespace v3d::ctl {
namespace {

/// Minutes and seconds, with hours from one hour on: "0:50", "1:02:03".
std::string length_text(double seconds) {
  const auto whole = static_cast<int64_t>(seconds + 0.5);
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string mesh_count_text(const take::TakeListing& take) {
  const std::string proxy = take.proxy_bytes > 0 ? " and proxy" : "";
  return (take.meshes ? format_count(*take.meshes) + " meshes" : "mesh.v3d cannot be read") + proxy;
}

std::string listing_line(const take::TakeListing& take, size_t name_width) {
  const std::string text = fmt::format(
      "{:<{}}  {}  {:<10} {:<10}  {:>7}  {:>8}  {:3} cameras x {:>7} pulses, {:g} Hz, {}",
      take.info.name, name_width, local_time(take.info.started, "%Y-%m-%d %H:%M"), take.verdict(),
      take.verified ? "verified" : "unverified", length_text(take.seconds()),
      format_bytes(static_cast<double>(take.bytes)), take.info.cameras.size(),
      format_count(take.info.pulses), take.info.rate_hz, mesh_count_text(take));
  const std::string slate = take.slate.text();
  return text + (take.timecode.empty() ? "" : ", timecode " + printable(take.timecode)) +
         (take.absent_nodes.empty() ? "" : ", without " + text_of(take.absent_nodes)) +
         (slate.empty() ? "" : "  " + slate);
}

}  // namespace

std::filesystem::path takes_folder(const CommandLine& line, const TakesArguments& arguments) {
  return arguments.folder.empty() ? line.studio().storage.takes : arguments.folder;
}

std::vector<take::TakeListing> named_takes(const CommandLine& line,
                                           const TakesArguments& arguments) {
  const std::filesystem::path folder = takes_folder(line, arguments);
  std::vector<take::TakeListing> takes;
  for (const std::string& name : arguments.names) {
    if (!is_file_name(name)) {
      throw InputError("'" + name + "' is no name of a take: " + std::string(kFileNameRule));
    }
    takes.push_back(take::read_take_listing({folder / name}));
  }
  return takes;
}

std::vector<std::string> listing_lines(const std::vector<take::TakeListing>& takes) {
  size_t width = 4;
  for (const take::TakeListing& take : takes) width = std::max(width, take.info.name.size());
  std::vector<std::string> lines;
  for (const take::TakeListing& take : takes) lines.push_back(listing_line(take, width));
  return lines;
}

void print_listing(const std::vector<take::TakeListing>& takes, bool json) {
  for (const take::TakeListing& take : takes) {
    if (!take.meshes) note("v3dctl: " + printable(take.mesh_error));
  }
  if (json) {
    std::printf("%s\n", control::takes_json(takes, 2).c_str());
    return;
  }
  for (const std::string& line : listing_lines(takes)) std::printf("%s\n", line.c_str());
}

std::string interrupted_text(const std::vector<take::InterruptedDeletion>& deletions) {
  std::vector<std::string> names;
  for (const take::InterruptedDeletion& deletion : deletions)
    names.push_back(printable(deletion.take));
  return "the deletion of " + format_count(std::ssize(names)) +
         (names.size() == 1 ? " take" : " takes") + " was interrupted: " + join_names(names);
}

std::vector<std::string> printable_lines(std::vector<std::string> lines) {
  for (std::string& line : lines) line = printable(line);
  return lines;
}

cli::Command add_takes_subcommand(cli::Command takes, const std::string& name,
                                  const std::string& description, const std::string& example) {
  cli::Command command = takes.add_subcommand(name, description);
  command.accept_parent_options();
  command.footer("Example:\n  $ " + example);
  return command;
}

void add_names_option(cli::Command command, const SharedTakesArguments& arguments) {
  command.add_option("NAME", arguments->names, "Takes").required();
}

}  // namespace v3d::ctl
