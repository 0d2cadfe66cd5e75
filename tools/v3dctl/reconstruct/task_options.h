// Options for commands whose work several processes share, and the hidden commands of their tasks.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "take/take.h"
#include "v3dctl/command_line.h"
#include "v3dctl/reconstruct/task_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

struct TaskArguments {
  std::string partition;
  int processes = 0;
  bool slurm = false;
};

/// Adds --processes, --slurm and --partition.
void add_task_options(cli::Command command, TaskArguments& arguments);

/// Where the tasks of a run are.
struct TaskPlaces {
  int processes = 0;      ///< of this PC, at a time; 0: on a cluster
  int threads = 1;        ///< of each task
  std::string partition;  ///< of the cluster; empty: the default one

  int all_threads() const { return threads * (processes > 0 ? processes : 1); }
};

/// The places that the options request; empty when this process does the work alone. `threads`: the
/// value of --threads, 0 without it. Reports on stderr when --slurm uses processes of this PC,
/// because it has no Slurm.
std::optional<TaskPlaces> task_places(const TaskArguments& arguments, int threads);

/// `command`: the name of add_task_command(). `min_shards`: of each task of TaskRunner::start() on
/// a cluster.
std::unique_ptr<TaskRunner> make_task_runner(const TaskPlaces& places, const TaskFolder& folder,
                                             const std::string& command, int64_t min_shards);

/// Work of one task: `shards` are indices.
using RunTask =
    std::function<void(const std::string& folder, take::FrameRange shards, int threads)>;

/// Adds a command for the tasks of another command, which is not in the help. The task ends with
/// the process that started it on the same PC.
void add_task_command(CommandLine& line, const std::string& name, const std::string& description,
                      RunTask run_task);

}  // namespace v3d::ctl
