"""Checks that no two headers define a public type of one name, and that no two folders have a source file of one name.

usage: test_distinct_names.py ROOT

A public type is a class, struct, enumeration or alias at the level of a namespace in a header outside tests/. Two namespaces
may not share a name either: a reader and a search see the name without its namespace. Files in tests/ are not checked: they have
the names of what they test, and one of tests/tools may test what one of tests/daemon does.
"""
import collections
import os
import pathlib
import re
import sys

# Files of one name that are right, with the reason.
SAME_FILES = {
    "main": "each example is a program that is read alone",
}
# Types of one name that are right, with the reason.
SAME_TYPES = {}

# clang-format does not indent namespaces, so a type at the beginning of a line is a member of a namespace.
TYPE = re.compile(
    r"^(?:template\s*<[^;{]*>\s*)?(?:"
    r"(?:class|struct|union|enum(?:\s+class)?)\s+(?:(?:alignas\(.*?\)|\[\[.*?\]\]|[A-Z][A-Z0-9_]+)\s+)?(\w+)\s*(?:final\s*)?(?::[^;{]*)?\{"
    r"|using\s+(\w+)(?:\s*\[\[[^=]*\]\])?\s*=\s*([^;]*);)", re.MULTILINE)
NAMESPACE = re.compile(r"^(?:inline )?namespace ([\w:]+) \{", re.MULTILINE)


def without_comments(text):
    """The text with comments as empty lines."""
    text = re.sub(r"/\*.*?\*/", lambda m: "\n" * m[0].count("\n"), text, flags=re.DOTALL)
    return re.sub(r"//.*", "", text)


def types_of(text):
    """Yields name, namespace and, of an alias, the type that it names."""
    text = without_comments(text)
    for found in TYPE.finditer(text):
        spaces = [space[1] for space in NAMESPACE.finditer(text, 0, found.start())]
        yield found[1] or found[2], spaces[-1] if spaces else "", found[3]


def same_types(headers):
    """Names that two headers define, with these headers. `headers`: text by path. One alias of one namespace may be repeated."""
    places = collections.defaultdict(set)
    for path, text in headers.items():
        for name, space, alias in types_of(text):
            places[name].add((space, alias) if alias else (space, path))
    headers_of = collections.defaultdict(set)
    for path, text in headers.items():
        for name, _, _ in types_of(text):
            headers_of[name].add(path)
    return {name: sorted(headers_of[name]) for name in sorted(places) if len(places[name]) > 1 and len(headers_of[name]) > 1}


def same_files(sources):
    """Names without ending that files of two folders have, with these folders."""
    folders = collections.defaultdict(set)
    for source in map(pathlib.PurePosixPath, sources):
        folders[source.stem].add(str(source.parent))
    return {name: sorted(folders[name]) for name in sorted(folders) if len(folders[name]) > 1}


def sources_of(root):
    """Paths below the root, without tests and what a build writes."""
    found = []
    for folder, folders, files in os.walk(root):
        folders[:] = [name for name in folders if not name.startswith(".") and name not in ("build", "node_modules")]
        if pathlib.Path(folder) == root:
            folders.remove("tests")
        found += [(pathlib.Path(folder) / name).relative_to(root).as_posix() for name in files if name.endswith((".h", ".cc", ".c", ".inc"))]
    return sorted(found)


def check_itself():
    """What is a type, and what is none."""
    one = {"a/a.h": "namespace v3d::a {\nstruct Rig;\nclass Pose final : public Base {\n  struct Part {};\n};\nusing Part = int;\n"}
    assert same_types(one | {"b/b.h": "namespace v3d::b {\nenum class Pose : uint8_t { kA };\n}"}) == {"Pose": ["a/a.h", "b/b.h"]}
    assert same_types(one | {"b/b.h": "namespace v3d::b {\nstruct Rig {};\n// struct Pose {\n}"}) == {}
    assert same_types(one | {"b/b.h": "namespace v3d::b {\ntemplate <int N>\nstruct Part {\n};\n}"}) == {"Part": ["a/a.h", "b/b.h"]}
    assert same_types(one | {"b/b.h": "namespace v3d::a {\nusing Part = int;\n}"}) == {}
    assert same_types(one | {"b/b.h": "namespace v3d::a {\nusing Part = float;\n}"}) == {"Part": ["a/a.h", "b/b.h"]}
    assert same_files(["a/x.h", "a/x.cc", "b/y.h"]) == {} and same_files(["a/x.h", "b/x.cc"]) == {"x": ["a", "b"]}


def main():
    check_itself()
    root = pathlib.Path(sys.argv[1])
    sources = sources_of(root)
    headers = {source: (root / source).read_text() for source in sources if source.endswith(".h")}
    wrong = [f"type {name} is defined in {' and '.join(places)}" for name, places in same_types(headers).items() if name not in SAME_TYPES]
    wrong += [f"file {name} is in {' and '.join(folders)}" for name, folders in same_files(sources).items() if name not in SAME_FILES]
    print("\n".join(wrong))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
