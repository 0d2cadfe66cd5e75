// Options of `v3dctl reconstruct`.
#pragma once

#include <string>
#include <string_view>

#include "recon/surface/deform.h"
#include "v3dctl/command_line.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/task_options.h"

namespace v3d::ctl {

struct ReconstructArguments {
  ReconstructRequest request;
  std::string voxel, bounds, quality, proxy, proxy_quality, deform, frames, leave_out;
  std::string repair_pulses, passes;
  TaskArguments tasks;
  int min_views = 0;
  bool no_smoothing = false;
  bool json = false;
};

void add_reconstruct_options(cli::Command command, ReconstructArguments& arguments);

/// The request of parsed arguments. Throws InputError for bad values.
ReconstructRequest request_of(const CommandLine& line, const ReconstructArguments& arguments);

/// The pulses of --repair-pulses, ascending: "live" for those of the take (read_repaired_pulses()),
/// or frames and ranges A:B such as "3,7:12". Throws InputError for other text, and as
/// read_repaired_pulses() does.
std::vector<int64_t> parse_repair_pulses(std::string_view text, const take::TakePaths& take);

/// The passes of --passes: of all pulses, or with "live" those of the meshes in mesh.v3d, where
/// v3d-recond stated them. Throws InputError for other text, and where no mesh states passes.
void parse_passes(std::string_view text, const take::TakePaths& take, ReconstructRequest& request);

/// Parses "mode=paper,internal=0.3,photometric=0.4,silhouette=0.3,window=7,views=6,carving=1": any
/// of these in any order; missing ones have their defaults. Throws InputError for other text and
/// for values that check() rejects.
recon::DeformOptions parse_deform(std::string_view text);

}  // namespace v3d::ctl
