// OLA's daemon with a simulated DMX interface.
#pragma once

#include <signal.h>

#include <fstream>
#include <string>
#include <vector>

#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d::test {

/// olad in the network of this test, whose universe 1 drives the interface of OLA's plugin "dummy".
class Olad {
 public:
  Olad()
      : process_(
            (write_settings(),
             // olad refuses to run as root, so it is another user in its own namespace.
             std::vector<std::string>{"/usr/bin/unshare", "--user", "--map-user=1000",
                                      "/usr/bin/olad", "--config-dir", folder_.path(), "--no-http",
                                      "--no-register-with-dns-sd", "--log-level", "3"}),
            folder_ / "log") {}

  /// The values that the interface has received, in order, as "0xa 0x14 ". Repetitions count once.
  std::vector<std::string> scenes() const {
    static const std::string kMark = " bytes: ";
    std::vector<std::string> found;
    std::ifstream log(folder_ / "log");
    for (std::string line; std::getline(log, line);) {
      const size_t at = line.find(kMark);
      if (line.find("Dummy port: got") == std::string::npos || at == std::string::npos) continue;
      const std::string values = line.substr(at + kMark.size());
      if (found.empty() || found.back() != values) found.push_back(values);
    }
    return found;
  }
  bool becomes(const std::string& values) const {
    return becomes_true([&] { return !scenes().empty() && scenes().back() == values; }, within(60));
  }

  /// Suspends olad, or lets it continue.
  void set_suspended(bool suspended) { process_.signal(suspended ? SIGSTOP : SIGCONT); }

 private:
  void write_settings() const {
    for (const char* plugin : {"artnet",
                               "dmx4linux",
                               "e131",
                               "espnet",
                               "ftdidmx",
                               "gpio",
                               "karate",
                               "kinet",
                               "milinst",
                               "opendmx",
                               "openpixelcontrol",
                               "osc",
                               "pathport",
                               "renard",
                               "sandnet",
                               "shownet",
                               "spi",
                               "stageprofi",
                               "uartdmx",
                               "usbdmx",
                               "usbserial"}) {
      std::ofstream(folder_ / ("ola-" + std::string(plugin) + ".conf")) << "enabled = false\n";
    }
    std::ofstream(folder_ / "ola-port.conf") << "1-1-O-0 = 1\n";
  }

  const TemporaryFolder folder_;
  ChildProcess process_;
};

}  // namespace v3d::test
