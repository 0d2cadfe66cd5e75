// Takes as lines of text.
#pragma once

#include <string>
#include <vector>

#include "take/take_listing.h"

namespace v3d::ctl {

/// "0:50", "1:02:03"
std::string format_length_of_time(double seconds);
/// One line each, in columns.
std::vector<std::string> listing_lines(const std::vector<TakeListing>& takes);

}  // namespace v3d::ctl
