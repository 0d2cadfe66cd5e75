// Options of the commands that read the meshes of a take.
#pragma once

#include <filesystem>
#include <string>

#include "cli/command.h"
#include "daemon/recorded/mesh_frames.h"

namespace v3d::ctl {

/// Adds --proxy: read proxy.v3d in place of mesh.v3d.
cli::Option add_proxy_flag(cli::Command command, bool& value);
/// The meshes of a take; `proxy`: the value of --proxy. Throws as MeshFrames.
recorded::MeshFrames open_meshes(const std::filesystem::path& take, bool proxy);

/// Adds --view-source, which needs the option --view-dependent; resolved_view_source() understands
/// its value.
void add_view_source_option(cli::Command command, cli::Option view_dependent, std::string& value);
recorded::ViewSource resolved_view_source(const std::string& value,
                                          const std::filesystem::path& take);

}  // namespace v3d::ctl
