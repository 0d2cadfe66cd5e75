// call-probe NAME...: makes each named system call with invalid arguments and prints "NAME ERROR",
// with the error number, or 0 for none. Skips names that this architecture does not have. A lab
// test runs it under the settings of a unit; a call that the unit's filter forbids fails with the
// filter's error. Without names, it prints "NUMBER NAME" of all calls.
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace {

struct Call {
  const char* name;
  long number;
};

constexpr Call kCalls[] = {
#include "system_calls.inc"
};

void make(const Call& call) {
  errno = 0;
  const long result = syscall(call.number, -1L, -1L, -1L, -1L, -1L, -1L);
  std::printf("%s %d\n", call.name, result == -1 ? errno : 0);
}

}  // namespace

int main(int argc, char** argv) {
  for (const Call& call : kCalls) {
    if (argc == 1) std::printf("%ld %s\n", call.number, call.name);
    for (int i = 1; i < argc; ++i) {
      if (std::strcmp(call.name, argv[i]) == 0) make(call);
    }
  }
  return 0;
}
