// Text of a small studio file, for tests.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace v3d::test {

/// A studio file with these nodes, each with its cameras. The trigger is on the first node;
/// `trigger`: its other fields, by default those of the simulated trigger, which is sensed.
inline std::string studio_text(const std::map<std::string, std::vector<std::string>>& nodes,
                               const std::string& trigger = "wire = 'wire'") {
  std::string text = "name = 'dojo'\n", cameras;
  for (const auto& [node, names] : nodes) {
    text += "[[node]]\nname = '" + node + "'\n";
    for (const std::string& camera : names) {
      cameras +=
          "[[camera]]\nname = '" + camera + "'\nnode = '" + node + "'\naddress = '127.0.0.1'\n";
    }
  }
  return text + "[trigger]\nnode = '" + nodes.begin()->first + "'\n" + trigger + "\n" + cameras +
         "[space]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\n[reconstruction]\nnode = '" +
         nodes.begin()->first +
         "'\n[storage]\ntakes = 'takes'\nbackground = 'background'\ncalib = 'calib.toml'\n";
}

}  // namespace v3d::test
