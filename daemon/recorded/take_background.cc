#include "daemon/recorded/take_background.h"

#include "base/error.h"

namespace v3d {

std::optional<BackgroundModel> load_take_background(const TakePaths& paths,
                                                    const std::string& camera) {
  std::error_code error;
  if (std::filesystem::is_symlink(paths.background(), error)) {
    throw InputError(paths.background().string() +
                     ": it is a symbolic link; expected a folder of the take");
  }
  if (!has_background(paths.background(), camera)) return std::nullopt;
  return load_background(paths.background(), camera);
}

}  // namespace v3d
