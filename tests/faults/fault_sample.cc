#include "fault_sample.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <stdexcept>

namespace v3d::test {
namespace {

using Calls = std::set<std::string>;

const Calls kTransfers = {"read", "pread", "write", "writev", "pwrite", "pwritev", "copy"};
const Calls kAllocating = {"open", "write",  "writev", "pwrite",   "pwritev",   "mkdir",
                           "link", "rename", "copy",   "truncate", "fallocate", "fsync"};
/// Calls that a signal may interrupt while they wait (signal(7)).
const Calls kWaiting = {"read", "pread", "write",    "writev",    "pwrite",  "pwritev", "copy",
                        "open", "fsync", "truncate", "fallocate", "statvfs", "flock"};
/// Calls that may also fail with EINTR on a network file system or with FUSE.
const Calls kInterruptible = {"rename", "unlink", "mkdir", "mmap", "lseek"};

std::vector<std::string> kinds_of(const std::string& call) {
  std::vector<std::string> kinds = {"EIO"};
  if (kAllocating.contains(call)) kinds.emplace_back("ENOSPC");
  if (call == "open" || call == "opendir") kinds.emplace_back("EMFILE");
  if (call == "flock") kinds.emplace_back("ENOLCK");
  if (kTransfers.contains(call)) kinds.emplace_back("SHORT");
  if (kWaiting.contains(call) || kInterruptible.contains(call)) kinds.emplace_back("EINTR");
  return kinds;
}

/// Moves one fault of each group to the front of [first, end). Returns the end of these faults.
template <class Group>
auto move_one_of_each(std::vector<Fault>::iterator first, std::vector<Fault>::iterator end,
                      std::set<std::string>& seen, Group group) {
  return std::stable_partition(
      first, end, [&](const Fault& fault) { return seen.insert(group(fault)).second; });
}

/// Those of the share that V3D_FAULTS_SHARE names: "3/16" is the third of sixteen.
std::vector<Fault> shared(const std::vector<Fault>& faults) {
  const char* const share = std::getenv("V3D_FAULTS_SHARE");
  size_t number = 1, shares = 1;
  if (share != nullptr &&
      (std::sscanf(share, "%zu/%zu", &number, &shares) != 2 || number < 1 || number > shares)) {
    throw std::invalid_argument(std::string("V3D_FAULTS_SHARE=") + share + ": expected K/N");
  }
  return share_of(faults, number - 1, shares);
}

}  // namespace

std::vector<Fault> all_faults(const ProgramResult& counted, const std::string& program) {
  std::vector<Fault> faults;
  for (const auto& [call, count] : counted.calls) {
    for (uint32_t number = 1; number <= count; ++number) {
      for (const std::string& kind : kinds_of(call)) {
        faults.push_back({call, number, kind, program});
        // EINTR does not last: programs repeat an interrupted call without limit.
        if (kind != "EINTR") faults.push_back({call, number, kind, program, true});
      }
    }
  }
  return faults;
}

std::vector<Fault> sampled(std::vector<Fault> faults, size_t size) {
  const char* const wanted = std::getenv("V3D_FAULTS");
  if (wanted != nullptr) {
    if (wanted == std::string_view("all")) return shared(faults);
    std::erase_if(faults, [&](const Fault& fault) {
      return text_of(fault).find(wanted) == std::string::npos;
    });
    return faults;
  }
  std::shuffle(faults.begin(), faults.end(), std::mt19937(2009));
  std::set<std::string> families, pairs;
  const auto pair_of = [](const Fault& fault) { return fault.call + " " + fault.kind; };
  const auto others = move_one_of_each(faults.begin(), faults.end(), families,
                                       [](const Fault& fault) { return fault.call; });
  std::for_each(faults.begin(), others, [&](const Fault& f) { pairs.insert(pair_of(f)); });
  move_one_of_each(others, faults.end(), pairs, pair_of);
  faults.resize(std::min(faults.size(), std::max(size, families.size())));
  return faults;
}

std::vector<Fault> share_of(const std::vector<Fault>& faults, size_t part, size_t parts) {
  std::vector<Fault> share;
  for (size_t i = part; i < faults.size(); i += parts) share.push_back(faults[i]);
  return share;
}

bool must_succeed(const Fault& fault) {
  if (fault.program == "rsync") return false;  // it reports EINTR as an error
  return fault.kind == "SHORT" || (fault.kind == "EINTR" && kWaiting.contains(fault.call));
}

std::string cause_of(const Fault& fault) {
  static const std::map<std::string, int> kErrors = {
      {"EIO", EIO}, {"ENOSPC", ENOSPC}, {"EMFILE", EMFILE}, {"ENOLCK", ENOLCK}, {"EINTR", EINTR}};
  const auto error = kErrors.find(fault.kind);
  return error == kErrors.end() ? "" : std::strerror(error->second);
}

std::string text_of(const Fault& fault) {
  return fault.call + " " + std::to_string(fault.number) + " " + fault.kind +
         (fault.lasts ? " and all later calls" : "");
}

}  // namespace v3d::test
