#include "daemon/bus/accepted_serial.h"

#include <cerrno>
#include <utility>

#include "base/config/toml_file.h"
#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {
namespace {

constexpr uint64_t kMaxBytes = 4096;

}  // namespace

AcceptedSerial::AcceptedSerial(std::filesystem::path path, std::string studio,
                               std::string authority)
    : path_(std::move(path)), studio_(std::move(studio)), authority_(std::move(authority)) {}

int64_t AcceptedSerial::load() const {
  if (path_.empty()) return 0;
  const auto text = io::read_file(path_, kMaxBytes, io::OpenMode::kReadWithinFolder);
  if (!text) {
    if (text.error().code == ENOENT) return 0;
    throw InputError(text.error().message);
  }
  const TomlTable table = TomlTable::parse(*text, path_);
  if (table.text("studio") != studio_ || table.text("authority") != authority_) return 0;
  const int64_t serial = table.integer("serial");
  if (serial < 1) table.fail("serial", "expected 1 or more");
  return serial;
}

io::Status AcceptedSerial::save(int64_t serial) const {
  if (path_.empty()) return {};
  return io::replace_file(path_,
                          "# The newest member list that this node has accepted. It rejects lists "
                          "with a lower serial.\n"
                          "studio = " +
                              toml_string(studio_) + "\nauthority = " + toml_string(authority_) +
                              "\nserial = " + std::to_string(serial) + "\n");
}

}  // namespace v3d
