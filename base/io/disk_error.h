// Errors of a disk, as opposed to files that a user names wrongly.
#pragma once

#include "base/io/file.h"

namespace v3d::io {

/// For a file that could not be created: throws std::runtime_error (exit status 1) where the disk
/// is full or faulty, otherwise InputError (exit status 2): the folder is missing, the name is
/// taken, or this user may not write there.
[[noreturn]] void throw_creation_error(const IoError& error);

}  // namespace v3d::io
