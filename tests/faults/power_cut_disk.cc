#include "power_cut_disk.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "power_cut.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;

constexpr auto kSize = "32M";

void run(const std::string& command) {
  const int status = std::system(("PATH=$PATH:/usr/sbin:/sbin " + command).c_str());
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) throw std::runtime_error(command);
}

}  // namespace

std::string create_mount_namespace() {
  if (geteuid() != 0) return "needs root, to mount a file system";
  if (unshare(CLONE_NEWNS) != 0 ||
      ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) {
    return std::string("cannot create a mount namespace: ") + std::strerror(errno);
  }
  if (access("/dev/loop-control", F_OK) != 0)
    return "needs loop devices; /dev/loop-control is missing";
  return "";
}

PowerCutDisk::PowerCutDisk(fs::path files, fs::path place)
    : files_(std::move(files)), place_(std::move(place)) {
  fs::create_directories(files_);
  const std::string file = image(number_).string();
  run("truncate -s " + std::string(kSize) + " " + file + " && mkfs.ext4 -q -F " + file);
  mount();
}

PowerCutDisk::~PowerCutDisk() { umount2(place_.c_str(), MNT_DETACH); }

void PowerCutDisk::save() {
  unmount();
  fs::rename(image(number_), files_ / "saved");
  restore();
}

void PowerCutDisk::restore() {
  if (fs::exists(image(number_))) {
    unmount();
    fs::remove(image(number_));
  }
  fs::copy_file(files_ / "saved", image(++number_));
  mount();
}

void PowerCutDisk::cut_power() const {
  if (!shut_down(place_.c_str())) {
    throw std::runtime_error("EXT4_IOC_SHUTDOWN: " + std::string(std::strerror(errno)));
  }
}

void PowerCutDisk::restart() {
  unmount();
  mount();
}

void PowerCutDisk::mount() const {
  run("mount -t ext4 -o loop " + image(number_).string() + " " + place_.string());
}
void PowerCutDisk::unmount() const {
  // A killed program may leave a child, such as rsync, that ends a little later.
  run("n=0; until umount " + place_.string() +
      "; do n=$((n+1)); [ $n -lt 200 ] || exit 1; sleep 0.05; done");
}

fs::path PowerCutDisk::image(int number) const {
  return files_ / ("disk" + std::to_string(number));
}

}  // namespace v3d::test
