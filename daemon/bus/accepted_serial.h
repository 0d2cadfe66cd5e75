// The highest serial number of a member list that a node has accepted, in a file, so that an older
// list is rejected after a restart too.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "base/io/result.h"

namespace v3d {

/// The file of one node. It belongs to a studio and an authority: the lists of another authority
/// have serial numbers of their own. One thread.
class AcceptedSerial {
 public:
  /// `path`: the file; empty: nothing is read or saved. `authority`: its public key, hexadecimal.
  AcceptedSerial(std::filesystem::path path, std::string studio, std::string authority);

  const std::filesystem::path& path() const { return path_; }
  /// The number in the file; 0 when there is no file, or when it belongs to another studio or
  /// authority. Throws InputError with path and cause when it cannot be read or is damaged.
  int64_t load() const;
  /// Replaces the file atomically.
  [[nodiscard]] io::Status save(int64_t serial) const;

 private:
  const std::filesystem::path path_;
  const std::string studio_, authority_;
};

}  // namespace v3d
