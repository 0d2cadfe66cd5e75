// check and preview: tests of the cameras with a few pulses.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "common/console.h"
#include "common/option_checks.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/camera_report.h"
#include "v3dctl/operate/short_train.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

// --- check

struct CheckOptions {
  bool json = false;
  ShortTrain train;
};

void print_text(const CheckReport& report) {
  for (const std::string& line : check_lines(report.cameras)) std::printf("%s\n", line.c_str());
  for (const std::string& line : sound_lines(report.sounds)) std::printf("%s\n", line.c_str());
  for (const std::string& node : report.unreadable) {
    note("v3dctl: cannot read the reply of " + node);
  }
}

int run_check(const CommandLine& line, const CheckOptions& options) {
  const Studio studio = line.studio();
  control::OperatorClient client(studio);
  catch_interrupts();
  bool may_clap = !studio.sounds.empty();
  const auto ask_once = [&] {
    if (std::exchange(may_clap, false)) note("clap once now to compare sound and pictures");
  };
  const control::Answer answer = run_train(client, studio, options.train, ask_once);
  const CheckReport report = parse_check_replies(answer);
  if (options.json) {
    std::printf("%s\n", check_json(report).dump(2).c_str());
  } else {
    print_text(report);
  }
  return all_good(report) ? kExitDone : kExitIncomplete;
}

// --- preview

constexpr double kHealthSeconds = 2.5;       // nodes report once a second
constexpr double kPreviewSeconds = 5;        // nodes send a preview about once a second
constexpr double kLatePreviewSeconds = 0.5;  // after the last pulse
constexpr int kJpegQuality = 90;

struct PreviewOptions {
  std::filesystem::path out = "contact.jpg";
  bool mask = false;
};

using Previews = std::map<std::string, wire::PreviewMessage>;  // last of each camera, by its name

/// Receives previews until `deadline`, or until every camera has one.
void receive_until(control::OperatorClient& client, const Studio& studio, MonotonicInstant deadline,
                   Previews& previews) {
  while (auto preview = client.next_preview(deadline)) {
    const std::string camera = preview->camera;
    previews[camera] = std::move(*preview);
    if (previews.size() >= studio.cameras.size()) deadline = Monotonic::now();
    stop_if_interrupted();
  }
}

bool is_recording(control::OperatorClient& client) {
  const auto health = client.health(Monotonic::now() + from_seconds(kHealthSeconds));
  return std::any_of(health.begin(), health.end(), [](const auto& entry) {
    return entry.second.state == wire::NodeState::kRecording;
  });
}

Previews receive_previews(control::OperatorClient& client, const Studio& studio) {
  Previews previews;
  client.next_preview(Monotonic::now());  // joins the channel, so that no preview is missed
  if (is_recording(client)) {
    receive_until(client, studio, Monotonic::now() + from_seconds(kPreviewSeconds), previews);
    return previews;
  }
  const auto meanwhile = [&] { receive_until(client, studio, Monotonic::now(), previews); };
  run_train(client, studio, {.pulses = 2, .rate_hz = 0}, meanwhile);
  receive_until(client, studio, Monotonic::now() + from_seconds(kLatePreviewSeconds), previews);
  return previews;
}

SheetImage sheet_image_of(const std::string& camera, const Previews& previews, bool with_mask) {
  SheetImage entry{.name = camera, .image = {}, .mask = {}};
  const auto found = previews.find(camera);
  if (found == previews.end()) return entry;
  entry.image = decode_jpeg(found->second.jpeg, found->second.size);
  if (with_mask) entry.mask = found->second.mask;
  return entry;
}

void write_sheet(const std::filesystem::path& path, const Image& sheet) {
  if (path.extension() == ".png") return write_png(path, sheet.view());
  const std::vector<uint8_t> bytes = encode_jpeg(sheet.view(), kJpegQuality);
  replace_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

int run_preview(const CommandLine& line, const PreviewOptions& options) {
  const std::string kind = options.out.extension();
  if (kind != ".jpg" && kind != ".jpeg" && kind != ".png") {
    throw InputError("--out " + options.out.string() +
                     ": expected a name that ends in .jpg or .png");
  }
  check_output({"--out", options.out});
  const Studio studio = line.studio();
  control::OperatorClient client(studio);
  catch_interrupts();
  const Previews previews = receive_previews(client, studio);
  std::vector<SheetImage> images;
  size_t received = 0;
  size_t masks = 0;
  for (const StudioCamera& camera : studio.cameras) {
    images.push_back(sheet_image_of(camera.name, previews, options.mask));
    received += images.back().image.has_value();
    masks += images.back().mask.has_value();
  }
  write_sheet(options.out, contact_sheet(images));
  std::printf("%s: %zu of %zu cameras\n", options.out.c_str(), received, studio.cameras.size());
  if (options.mask && masks < received) {
    note(std::to_string(received - masks) +
         " cameras have no background model. Try: v3dctl background");
  }
  return received == studio.cameras.size() ? kExitDone : kExitIncomplete;
}

}  // namespace

void add_check(CommandLine& line) {
  cli::Command command =
      line.add("check",
               "Make pulses without recording, and report for every camera whether it "
               "is ready for a take",
               {"v3dctl check", "v3dctl check --pulses 500 --json"});
  auto options = std::make_shared<CheckOptions>();
  add_json_flag(command, options->json);
  command.add_option("--pulses", options->train.pulses, "The number of pulses")
      .type_name("N")
      .show_default()
      .check(cli::integer_in(2, 100'000));
  command
      .add_option("--rate", options->train.rate_hz,
                  "Pulses per second (otherwise as in the studio file)")
      .type_name("HZ")
      .check(pulse_rate());
  line.on_run(command, [&line, options] { return run_check(line, *options); });
}

void add_preview(CommandLine& line) {
  cli::Command command = line.add("preview", "Write the images of all cameras to one picture",
                                  {"v3dctl preview", "v3dctl preview --mask --out contact.png"});
  auto options = std::make_shared<PreviewOptions>();
  command.add_flag("--mask", options->mask, "Draw the outlines of the silhouettes");
  command.add_option("--out", options->out, "The picture: .jpg or .png")
      .type_name("FILE")
      .show_default();
  line.on_run(command, [&line, options] { return run_preview(line, *options); });
}

}  // namespace v3d::ctl
