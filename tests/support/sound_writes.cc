// Records when a program plays sound, preloaded with LD_PRELOAD. After each snd_pcm_writei() and
// before each snd_pcm_delay(), the file $V3D_SOUND_WRITES gets a line with CLOCK_MONOTONIC, ns, and
// the frames written until then.
#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace {

void record(long frames) {
  static const int file = [] {
    const char* const path = std::getenv("V3D_SOUND_WRITES");
    return path == nullptr ? -1 : open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  }();
  static long total = 0;
  total += frames;
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  char line[64];
  const int length =
      std::snprintf(line, sizeof line, "%ld%09ld %ld\n", now.tv_sec, now.tv_nsec, total);
  if (write(file, line, static_cast<size_t>(length)) != length) std::abort();
}

}  // namespace

// One thread of the program calls these.

extern "C" long snd_pcm_writei(void* pcm, const void* buffer, unsigned long size) {
  using Write = long(void*, const void*, unsigned long);
  static auto* const next = reinterpret_cast<Write*>(dlsym(RTLD_NEXT, "snd_pcm_writei"));
  const long frames = next(pcm, buffer, size);
  if (frames > 0) record(frames);
  return frames;
}

extern "C" int snd_pcm_delay(void* pcm, long* delay) {
  using Delay = int(void*, long*);
  static auto* const next = reinterpret_cast<Delay*>(dlsym(RTLD_NEXT, "snd_pcm_delay"));
  record(0);
  return next(pcm, delay);
}
