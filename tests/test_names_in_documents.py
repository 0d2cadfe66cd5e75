"""Checks that every test that a document names exists: `Suite.test`, or `Suite.beginning_*`.

usage: test_names_in_documents.py ROOT
"""
import fnmatch
import pathlib
import re
import sys

ROOT = pathlib.Path(sys.argv[1])
# Suites whose tests are scripts: their names are in the CMakeLists.txt, or are the files of the lab's stories.
SCRIPTED = {"Appliance", "Blender", "CommandLine", "Export", "Golden", "Lab", "Library", "Members", "Packages", "Protocol", "Python", "Sources",
            "Takes", "Units", "Viewer"}
# What looks like one in the documents and is none.
NO_TESTS = {"phase_us", "txt"}


def gtest_names():
    for source in (ROOT / "tests").rglob("*.cc"):
        for suite, test in re.findall(r"(?:TEST(?:_F|_P)?|RC_GTEST_PROP)\(\s*(\w+)\s*,\s*(\w+)", source.read_text()):
            yield f"{suite}.{test}"


names = set(gtest_names())
scripts = "\n".join(file.read_text() for file in (ROOT / "tests").rglob("CMakeLists.txt"))
scripts += "\n".join(file.name for file in (ROOT / "tests/lab/stories").iterdir())


def exists(suite, test):
    if fnmatch.filter(names, f"{suite}.{test}"):
        return True
    return suite in SCRIPTED and test.rstrip("*") in scripts


missing = []
for document in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / "tests/flaky_stories"]:
    pattern = r"^(\w+)\.(\w+)" if document.suffix != ".md" else r"`([A-Z][A-Za-z0-9]*)\.([a-z]\w*\*?|\*)`"
    for suite, test in re.findall(pattern, document.read_text(), re.MULTILINE):
        if test not in NO_TESTS and not exists(suite, test):
            missing.append(f"{document.relative_to(ROOT)}: there is no test {suite}.{test}")
print("\n".join(missing))
sys.exit(bool(missing))
