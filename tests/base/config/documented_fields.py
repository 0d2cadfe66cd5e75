"""Checks that v3d-studio.toml(5) names every field that the reader of the studio file knows, in the section of its table.

The reader's functions take a table as their first argument. This script follows them from read of the whole file to the
fields, and so knows the table of each field. Fields of [camera_defaults] are those of [[camera]].

usage: documented_fields.py ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
page = (root / "docs/man/v3d-studio.toml.5").read_text()
source = "\n".join(path.read_text() for path in sorted((root / "base/config").glob("studio_*.cc")))
SAME_SECTION = {"camera_defaults": "camera"}
TYPES = "has|is_text|text|text_or|number|number_or|integer|integer_or|boolean_or|numbers|integers|texts|rows|table|tables"

# name -> (its parameter that is a table, body)
functions = {}
for match in re.finditer(r"^[\w:<>&*, ]+?\b(\w+)\(const TomlTable& (\w+)[^;{]*?\) \{(.*?)^\}", source, re.MULTILINE | re.DOTALL):
    functions[match[1]] = (match[2], match[3])


def section_of(parent, name):
    section = f"{parent}.{name}" if parent else name
    return SAME_SECTION.get(section, section)


def fields_of(function, section, found):
    """Adds (section, field) for all that `function` reads from its table, and from tables in it."""
    parameter, body = functions[function]
    tables = {parameter: section}
    for variable, parent, name in re.findall(r"TomlTable& (\w+) : (\w+)\.tables\(\"(\w+)\"\)", body) + re.findall(
            r"TomlTable (\w+) = (\w+)\.table\(\"(\w+)\"\)", body):
        tables[variable] = section_of(tables[parent], name)
    for variable, field in re.findall(rf"\b(\w+)\.(?:{TYPES})\(\"(\w+)\"", body) + re.findall(r"\w\(\s*(\w+),\s*\"(\w+)\"", body):
        if variable in tables:
            found.add((tables[variable], field))
    calls = [(callee, tables[variable]) for callee, variable in re.findall(r"\b(\w+)\((\w+)[,)]", body) if variable in tables]
    calls += [(callee, section_of(tables[parent], name))
              for callee, parent, name in re.findall(r"\b(\w+)\((\w+)\.table\(\"(\w+)\"\)", body) if parent in tables]
    for callee, inner in calls:
        if callee in functions:
            fields_of(callee, inner, found)


def documented_in(text):
    """(section, field) for the tag of each .TP; a heading without brackets is a field of the file."""
    found = set()
    section = ""
    lines = text.splitlines()
    for line, following in zip(lines, lines[1:]):
        if line.startswith(".SS "):
            heading = line.removeprefix(".SS ")
            section = heading.strip("[]")
            found.add(("", section.split(".")[0]))
            if "." in section:
                found.add(tuple(section.rsplit(".", 1)))
        elif line == ".TP":
            found |= {(section, word) for word in re.findall(r"\b[a-z_0-9]+\b", re.sub(r"\[.*?\]", "", following))}
    return found


read = set()
for function in sorted(functions):
    if functions[function][0] == "file":
        fields_of(function, "", read)
if len(read) < 100:
    sys.exit(f"found only {len(read)} fields in the reader; the patterns of this test are out of date")
missing = {(section, field) for section, field in read - documented_in(page) if field not in SAME_SECTION}
for section, field in sorted(missing):
    print(f"docs/man/v3d-studio.toml.5: section [{section}]: the field {field} is missing")
# A field that only another section has must count as missing.
without = page.replace('.BR rate_hz " [25]"', '.BR other " [25]"')
if without == page or ("trigger", "rate_hz") not in read - documented_in(without):
    sys.exit("this test does not notice that rate_hz of [trigger] is only in another section")
sys.exit(bool(missing))
