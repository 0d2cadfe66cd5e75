"""Checks that a test includes each header of recon/: a unit without a test of its own is found.

usage: test_included_headers.py ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
headers = {header.relative_to(root).as_posix() for header in (root / "recon").rglob("*.h")}
tests = [file for pattern in ("*.cc", "*.h") for file in (root / "tests").rglob(pattern)]
included = {header for test in tests for header in re.findall(r'^#include "(recon/[^"]+)"', test.read_text(), re.MULTILINE)}
missing = sorted(headers - included)
print("\n".join(f"{header}: no test includes it; add tests/{header.removesuffix('.h')}_test.cc" for header in missing))
sys.exit(bool(missing) or not headers)
