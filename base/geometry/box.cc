#include "base/geometry/box.h"

#include <array>
#include <string>

#include "base/core/error.h"
#include "base/core/units.h"

namespace v3d {

Box parse_bounds(std::string_view text) {
  std::array<double, 6> v{};
  std::string_view rest = text;
  bool good = true;
  for (size_t i = 0; i < v.size() && good; ++i) {
    good = take_number(rest, v[i]);
    if (good && i + 1 < v.size()) {
      good = rest.starts_with(',');
      rest.remove_prefix(good ? 1 : 0);
    }
  }
  if (!good || !rest.empty() || v[0] >= v[3] || v[1] >= v[4] || v[2] >= v[5]) {
    throw InputError("bounds '" + std::string(text) +
                     "': expected X0,Y0,Z0,X1,Y1,Z1 in metres, with X0 < X1, Y0 < Y1 and Z0 < Z1");
  }
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

}  // namespace v3d
