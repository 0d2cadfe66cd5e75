// Images whose true silhouettes are known: people of one studio pasted onto another room.
//
// People are cut out of studio20 by its masks at half size, the room is room4; both are real
// images. What is pasted is the truth: every pixel that is person by half or more.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::bench {

/// What happens to a picture between the empty room that was learnt and now.
struct Condition {
  std::string name;
  double noise =
      1.5;          ///< standard deviation, grey values; of the plates as well: it is the camera's
  double gain = 0;  ///< brightness off by this part, up and down by turns
  double shadow = 0;  ///< what the person's shadow takes of the light in its core
};

/// Clean, noise, gain change, soft shadow, all of them.
const std::vector<Condition>& conditions();

struct Composite {
  Image colour;  ///< RGB8
  Mask truth;
};

/// One camera of the room under one condition.
struct Scene {
  std::vector<Image> plates;  ///< RGB8
  std::vector<Composite> composites;
};

/// One scene per camera of the room; the same for the same data. `data` holds room4/ and studio20/.
/// Throws InputError naming the file that is missing.
std::vector<Scene> make_scenes(const std::filesystem::path& data, const Condition& condition);

}  // namespace v3d::bench
