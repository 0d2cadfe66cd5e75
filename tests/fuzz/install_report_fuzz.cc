// Reports of appliances about the installation of an update.
#include <string_view>

#include "v3dctl/setup/update.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto report = v3d::ctl::parse_install_report(text, "7");
  if (report && report->message.find('\n') != std::string::npos) __builtin_trap();
  return 0;
}
