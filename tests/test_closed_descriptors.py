"""Checks that only UniqueFd closes file descriptors: code that closes them by hand leaks one when an exception ends it.

usage: test_closed_descriptors.py ROOT

Files in tests/ and examples/ are not checked.
"""
import pathlib
import re
import sys

sys.dont_write_bytecode = True
from test_distinct_names import sources_of

OWNER = "base/io/unique_fd.h"
# A call with one variable as its argument, and not of a member: close(fd_), ::close(ends[1]).
CALL = re.compile(r"(?<![\w.>:])(?:::)?close\([a-z_]\w*(?:\[\w+\])?(?:\.fd)?\)")


def calls_in(text):
    return [number for number, line in enumerate(text.splitlines(), 1) if CALL.search(line.split("//")[0])]


def self_test():
    for text in ("close(fd_);", "if (fd >= 0) ::close(fd);", "for (;;) {\n  close(ends[1]);"):
        assert calls_in(text), text
    for text in ("file.close(fd);", "void close();", "int close(int64_t commanded);", "impl_->close(x);", "reset(); // close(fd)"):
        assert not calls_in(text), text


self_test()
root = pathlib.Path(sys.argv[1])
checked = [source for source in sources_of(root) if not source.startswith("examples/") and source != OWNER]
found = [f"{source}:{number}: closes a file descriptor; let io::UniqueFd own it"
         for source in checked for number in calls_in((root / source).read_text())]
print("\n".join(found))
sys.exit(bool(found) or not checked)
