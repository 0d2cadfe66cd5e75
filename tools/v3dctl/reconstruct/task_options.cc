#include "v3dctl/reconstruct/task_options.h"

#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <utility>

#include "base/io/child_process.h"
#include "common/console.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"

namespace v3d::ctl {
namespace {

TaskPlaces on_this_pc(int processes, int threads) {
  ReconstructRequest request;
  request.threads = threads;
  return {.processes = processes,
          .threads = std::max(1, threads_of(request) / processes),
          .partition = {}};
}

struct ShardArguments {
  std::string folder, shards;
  int threads = 1;
  int parent = 0;
};

int run(const ShardArguments& arguments, const RunTask& run_task) {
  catch_interrupts();
  if (arguments.parent != 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != arguments.parent) return kExitFailed;  // the parent ended before prctl()
  }
  run_task(arguments.folder, parse_frame_range(arguments.shards, "SHARDS"), arguments.threads);
  return kExitDone;
}

}  // namespace

void add_task_options(cli::Command command, TaskArguments& arguments) {
  cli::Option processes =
      command
          .add_option(
              "--processes", arguments.processes,
              "Divide the take among this many processes; the result is the same, and a repeated "
              "command continues an interrupted run")
          .type_name("N")
          .check(cli::integer_in(1, 1024));
  cli::Option slurm = command.add_flag(
      "--slurm", arguments.slurm,
      "Divide the take among the nodes of a Slurm cluster; without Slurm, one process per core");
  slurm.excludes(processes);
  command.add_option("--partition", arguments.partition, "The partition of the cluster")
      .type_name("NAME")
      .needs(slurm);
}

std::optional<TaskPlaces> task_places(const TaskArguments& arguments, int threads) {
  if (arguments.processes > 0) return on_this_pc(arguments.processes, threads);
  if (!arguments.slurm) return std::nullopt;
  if (has_program("sbatch")) {
    return TaskPlaces{
        .processes = 0, .threads = std::max(1, threads), .partition = arguments.partition};
  }
  const int cores = threads_of({});
  note("no Slurm on this PC (no sbatch on the PATH): using " + std::to_string(cores) +
       " processes");
  return on_this_pc(cores, threads);
}

std::unique_ptr<TaskRunner> make_task_runner(const TaskPlaces& places, const TaskFolder& folder,
                                             const std::string& command, int64_t min_shards) {
  if (places.processes > 0) {
    return std::make_unique<LocalTaskRunner>(folder, command, places.processes, places.threads);
  }
  return std::make_unique<SlurmTaskRunner>(folder, command, places.partition, places.threads,
                                           min_shards);
}

void add_task_command(CommandLine& line, const std::string& name, const std::string& description,
                      RunTask run_task) {
  cli::Command command = line.add(name, description, {});
  command.hide();  // not in the help
  auto arguments = std::make_shared<ShardArguments>();
  command.add_option("FOLDER", arguments->folder, "The folder of shards").required();
  command.add_option("SHARDS", arguments->shards, "Indices of shards in the take: A:B is A to B-1")
      .required();
  command.add_option("--threads", arguments->threads, "Worker threads");
  command.add_option("--parent", arguments->parent, "End when this process ends");
  line.on_run(command, [arguments, task = std::move(run_task)] { return run(*arguments, task); });
}

}  // namespace v3d::ctl
