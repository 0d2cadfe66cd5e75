#include "v3dctl/mesh_options.h"

namespace v3d::ctl {

cli::Option add_proxy_flag(cli::Command command, bool& value) {
  return command.add_flag("--proxy", value,
                          "The coarser meshes of proxy.v3d, which reconstruct --proxy makes, for a "
                          "quick preview");
}

recorded::MeshFrames open_meshes(const std::filesystem::path& take, bool proxy) {
  return proxy ? recorded::MeshFrames::of_proxy(take) : recorded::MeshFrames(take);
}

void add_view_source_option(cli::Command command, cli::Option view_dependent, std::string& value) {
  command
      .add_option("--view-source", value,
                  "With --view-dependent: source of the colours: the raw frames, the colours of "
                  "cameras in the meshes (camera-colours), or the raw frames where the take has "
                  "them")
      .type_name("automatic|photographs|mesh")
      .check(cli::one_of({"automatic", "photographs", "mesh"}))
      .show_default()
      .needs(view_dependent);
}

recorded::ViewSource resolved_view_source(const std::string& value,
                                          const std::filesystem::path& take) {
  using recorded::ViewSource;
  return recorded::resolved(value == "mesh"          ? ViewSource::kMesh
                            : value == "photographs" ? ViewSource::kPhotographs
                                                     : ViewSource::kAutomatic,
                            take);
}

}  // namespace v3d::ctl
