// check: are the cameras fit for a take?
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "common/console.h"
#include "common/pulse_rate_option.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/camera_check.h"
#include "v3dctl/operate/pulse_train.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

struct Options {
  bool json = false;
  PulseTrain train;
};

void print_text(const CheckFindings& findings) {
  for (const std::string& line : check_lines(findings.cameras)) std::printf("%s\n", line.c_str());
  for (const std::string& node : findings.unreadable) {
    note("v3dctl: no readable account from " + node);
  }
}

int run_check(const CommandLine& line, const Options& options) {
  const Studio studio = line.studio();
  OperatorClient client(studio);
  catch_interrupts();
  const Answer answer = run_train(client, studio, options.train, [] {});
  const CheckFindings findings = read_check(answer);
  if (options.json) {
    std::printf("%s\n", check_json(findings).dump(2).c_str());
  } else {
    print_text(findings);
  }
  return all_good(findings) ? kExitDone : kExitNotWhole;
}

}  // namespace

void add_check(CommandLine& line) {
  CLI::App* command = line.add("check",
                               "Fire pulses without recording, and say of every camera whether it "
                               "is fit for a take",
                               {"v3dctl check", "v3dctl check --pulses 500 --json"});
  auto options = std::make_shared<Options>();
  add_json_flag(command, options->json);
  command->add_option("--pulses", options->train.pulses, "So many pulses")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(2, 100'000));
  command
      ->add_option("--rate", options->train.rate_hz,
                   "Pulses per second (else as the studio file says)")
      ->type_name("HZ")
      ->check(check_pulse_rate);
  line.on_run(command, [&line, options] { return run_check(line, *options); });
}

}  // namespace v3d::ctl
