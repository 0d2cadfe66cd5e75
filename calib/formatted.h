// Numbers in the text of the reports.
#pragma once

#include <string>

namespace v3d::calib {

/// Up to 511 characters, as printf() makes them.
__attribute__((format(printf, 1, 2))) std::string print(const char* format, ...);

}  // namespace v3d::calib
