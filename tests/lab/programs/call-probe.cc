// call-probe NAME...: makes every named system call, with arguments that no call accepts, and
// prints "NAME ERROR" for each, the error by its number, 0 for none. Names that this architecture
// does not have are left out. A story runs it under the settings of a unit: a call that the unit's
// filter forbids has the error that the filter names. Without names it prints "NUMBER NAME" of all
// calls.
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
