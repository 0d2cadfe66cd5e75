// Copies a bundle or a request to the folder of an appliance, as `v3dctl update` does.
//
// usage: update_driver bundle|request FOLDER FILE|NUMBER
#include <cstdio>
#include <exception>
#include <string>

#include "common/console.h"
#include "v3dctl/setup/update.h"

int main(int count, char** words) {
  if (count != 4) return 2;
  const std::string host = v3d::ctl::host_name();  // rsync needs no remote shell for it
  try {
    const v3d::ctl::UpdateFolder folder("", words[2]);
    if (words[1] == std::string("bundle")) {
      folder.send_bundle(host, words[3]);
    } else {
      folder.send_request(host, words[3]);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "update_driver: %s\n", error.what());
    return 1;
  }
  return 0;
}
