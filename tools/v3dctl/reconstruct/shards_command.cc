#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>

#include "base/error.h"
#include "v3dctl/command_line.h"
#include "v3dctl/process.h"
#include "v3dctl/reconstruct/sharded_reconstruction.h"

namespace v3d::ctl {
namespace {

struct Arguments {
  std::string folder, pieces;
  int threads = 1;
  int parent = 0;
};

int run(const Arguments& arguments) {
  catch_interrupts();
  if (arguments.parent != 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != arguments.parent) return kExitFailed;  // it has gone already
  }
  reconstruct_pieces(PieceFolder(arguments.folder), parse_frame_range(arguments.pieces),
                     arguments.threads);
  return kExitDone;
}

}  // namespace

void add_reconstruct_pieces(CommandLine& line) {
  CLI::App* command =
      line.add("reconstruct-pieces", "A task of v3dctl reconstruct --processes", {});
  command->group("");  // not for people
  auto arguments = std::make_shared<Arguments>();
  command->add_option("FOLDER", arguments->folder, "Of the pieces")->required();
  command->add_option("A:B", arguments->pieces, "By their place in the take")->required();
  command->add_option("--threads", arguments->threads, "Worker threads");
  command->add_option("--parent", arguments->parent, "The process to end with");
  line.on_run(command, [arguments] { return run(*arguments); });
}

}  // namespace v3d::ctl
