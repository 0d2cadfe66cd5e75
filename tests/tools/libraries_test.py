"""Tests that ARCHITECTURE.md has the number of shared libraries of each program. Run with the source folder, v3dctl, v3d-recond,
v3d-viewd and v3d-captured. The numbers are those of Debian 12."""
import pathlib
import re
import subprocess
import sys

source, *programs = sys.argv[1:]
if 'VERSION_ID="12"' not in pathlib.Path("/etc/os-release").read_text():
    print("skipped: the numbers are those of Debian 12")
    sys.exit(77)


def libraries(program):
    """The libraries that the loader finds, without those of sanitizers."""
    lines = subprocess.run(["ldd", program], check=True, capture_output=True, text=True).stdout.splitlines()
    return len([line for line in lines if "=> /" in line and not re.search(r"lib(a|l|t|ub)san\.", line)])


counts = [libraries(program) for program in programs]
sentence = "`v3dctl` needs {}, `v3d-recond` {}, `v3d-viewd` {} and `v3d-captured` {}.".format(*counts)
text = " ".join((pathlib.Path(source) / "ARCHITECTURE.md").read_text().split())
assert sentence in text, f"ARCHITECTURE.md does not have the sentence: {sentence}"
