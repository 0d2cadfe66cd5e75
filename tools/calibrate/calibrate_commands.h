// The subcommands of `v3dctl calibrate`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "v3dctl/command_line.h"

namespace v3d::calibrate {

/// Adds `calibrate` with all its subcommands.
void add_calibrate(ctl::CommandLine& line);

/// Adds a subcommand. `examples` are printed below its help, each after "  $ ".
cli::Command add_under(cli::Command calibrate, const std::string& name,
                       const std::string& description, const std::vector<std::string>& examples);
void add_board_option(cli::Command command, std::string& board);

/// Like save_calib(). Where the user has interrupted the command, also during a fit, it throws
/// std::runtime_error instead, and the file remains unchanged.
void save_result(const std::filesystem::path& path, const Rig& rig);

void add_guess(ctl::CommandLine& line, cli::Command calibrate);
void add_intrinsics(ctl::CommandLine& line, cli::Command calibrate);
void add_rig(ctl::CommandLine& line, cli::Command calibrate);
void add_floor(ctl::CommandLine& line, cli::Command calibrate);
void add_refine(ctl::CommandLine& line, cli::Command calibrate);
void add_colour(ctl::CommandLine& line, cli::Command calibrate);
void add_convert(ctl::CommandLine& line, cli::Command calibrate);

}  // namespace v3d::calibrate
