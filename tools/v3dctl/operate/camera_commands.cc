// preview: what every camera sees, on one picture.
#include <cstdio>

#include "base/error.h"
#include "base/file.h"
#include "base/jpeg.h"
#include "base/png_file.h"
#include "common/console.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/contact_sheet.h"
#include "v3dctl/operate/pulse_train.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

constexpr double kHealthSeconds = 2.5;  // nodes report once a second
constexpr double kPreviewSeconds = 5;   // and send previews about as often
constexpr double kLatePreviews = 0.5;
constexpr int kQuality = 90;

struct Options {
  std::filesystem::path out = "contact.jpg";
  bool mask = false;
};

using Previews = std::map<std::string, PreviewMessage>;  // the last of each camera

/// Takes what came until `deadline`, or until every camera has been seen.
void gather(OperatorClient& client, const Studio& studio, MonotonicInstant deadline,
            Previews& previews) {
  while (auto preview = client.next_preview(deadline)) {
    const std::string camera = preview->camera;
    previews[camera] = std::move(*preview);
    if (previews.size() >= studio.cameras.size()) deadline = Monotonic::now();
    stop_if_interrupted();
  }
}

bool pulses_run(OperatorClient& client) {
  const auto health = client.health(Monotonic::now() + from_seconds(kHealthSeconds));
  return std::any_of(health.begin(), health.end(),
                     [](const auto& entry) { return entry.second.state == NodeState::kRecording; });
}

Previews see(OperatorClient& client, const Studio& studio) {
  Previews previews;
  client.next_preview(Monotonic::now());  // from now on nothing is missed
  if (pulses_run(client)) {
    gather(client, studio, Monotonic::now() + from_seconds(kPreviewSeconds), previews);
    return previews;
  }
  const auto meanwhile = [&] { gather(client, studio, Monotonic::now(), previews); };
  run_train(client, studio, {.pulses = 2, .rate_hz = 0}, meanwhile);
  gather(client, studio, Monotonic::now() + from_seconds(kLatePreviews), previews);
  return previews;
}

SheetPicture picture_of(const std::string& camera, const Previews& previews, bool with_mask) {
  SheetPicture picture{.name = camera, .image = {}, .mask = {}};
  const auto found = previews.find(camera);
  if (found == previews.end()) return picture;
  picture.image = decode_jpeg(found->second.jpeg, found->second.size);
  if (with_mask) picture.mask = found->second.mask;
  return picture;
}

void write_sheet(const std::filesystem::path& path, const Image& sheet) {
  if (path.extension() == ".png") return write_png(path, sheet.view());
  const std::vector<uint8_t> bytes = encode_jpeg(sheet.view(), kQuality);
  replace_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

int run_preview(const CommandLine& line, const Options& options) {
  const std::string kind = options.out.extension();
  if (kind != ".jpg" && kind != ".jpeg" && kind != ".png") {
    throw InputError("--out " + options.out.string() +
                     ": expected a name that ends in .jpg or .png");
  }
  const Studio studio = line.studio();
  OperatorClient client(studio);
  catch_interrupts();
  const Previews previews = see(client, studio);
  std::vector<SheetPicture> pictures;
  size_t seen = 0;
  size_t masks = 0;
  for (const StudioCamera& camera : studio.cameras) {
    pictures.push_back(picture_of(camera.name, previews, options.mask));
    seen += pictures.back().image.has_value();
    masks += pictures.back().mask.has_value();
  }
  write_sheet(options.out, contact_sheet(pictures));
  std::printf("%s: %zu of %zu cameras\n", options.out.c_str(), seen, studio.cameras.size());
  if (options.mask && masks < seen) {
    note(std::to_string(seen - masks) + " cameras have no background yet. Try: v3dctl background");
  }
  return seen == studio.cameras.size() ? kExitDone : kExitNotWhole;
}

}  // namespace

void add_preview(CommandLine& line) {
  CLI::App* command = line.add("preview", "What every camera sees, on one picture",
                               {"v3dctl preview", "v3dctl preview --mask --out contact.png"});
  auto options = std::make_shared<Options>();
  command->add_flag("--mask", options->mask, "Draw the outlines of the silhouettes");
  command->add_option("--out", options->out, "The picture: .jpg or .png")
      ->type_name("FILE")
      ->capture_default_str();
  line.on_run(command, [&line, options] { return run_preview(line, *options); });
}

}  // namespace v3d::ctl
