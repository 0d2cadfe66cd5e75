// key: the secret that commands are sealed with.
#include <cstdio>

#include "base/error.h"
#include "base/studio_file.h"
#include "v3dctl/command.h"
#include "wire/studio_key.h"

namespace v3d::ctl {
namespace {

int run_new(const CommandLine& line, const std::string& out) {
  // The first thing that is made of a studio: there may be no studio file yet.
  const std::filesystem::path path = !out.empty()        ? std::filesystem::path(out)
                                     : line.has_studio() ? line.studio().network.key
                                                         : std::filesystem::path(kDefaultKey);
  if (std::filesystem::exists(path)) {
    throw InputError(path.string() +
                     ": a studio key is there already; move it away to make another");
  }
  StudioKey::make().save(path);
  std::printf("made %s: copy it to every PC of the studio, by a way that nobody listens to\n",
              path.c_str());
  return kExitDone;
}

}  // namespace

void add_key(CommandLine& line) {
  CLI::App* key = line.add("key", "The studio key: who has it may command the studio",
                           {"v3dctl key new", "v3dctl key new --out studio.key"});
  key->require_subcommand(1);
  CLI::App* make = key->add_subcommand("new", "Make a key, once for all PCs of a studio");
  make->fallthrough();
  auto out = std::make_shared<std::string>();
  make->add_option("--out", *out,
                   "Where to write it (else as the studio file says, else /etc/v3d/studio.key)")
      ->type_name("FILE");
  line.on_run(make, [&line, out] { return run_new(line, *out); });
}

}  // namespace v3d::ctl
