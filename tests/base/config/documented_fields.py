"""Checks that v3d-studio.toml(5) names every field that the reader of the studio file knows.

usage: documented_fields.py ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
page = (root / "docs/man/v3d-studio.toml.5").read_text()
documented = set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"^\.(?:B|BR|SS) (.*)$", page, re.MULTILINE))))
read = set()
for path in sorted((root / "base/config").glob("studio_*.cc")):
    source = path.read_text()
    read |= set(re.findall(r"(?:table|file|gate)\.(?:has|is_text|text|text_or|number|number_or|integer|integer_or|boolean_or|"
                           r"numbers|integers|texts|rows|table|tables)\(\"(\w+)\"", source))
    read |= set(re.findall(r"(?:ranged|ranged_int|choice|read_point|read_public_key|read_channel)\(\s*table,\s*\"(\w+)\"", source))
missing = sorted(read - documented)
if len(read) < 50:
    sys.exit(f"found only {len(read)} fields in the reader; the patterns of this test are out of date")
for field in missing:
    print(f"docs/man/v3d-studio.toml.5: the field {field} is missing")
sys.exit(bool(missing))
