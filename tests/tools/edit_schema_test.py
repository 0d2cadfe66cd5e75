"""Checks that docs/edit.schema.json agrees with the examples in docs/editing.md and with the cases of EditFile.

usage: edit_schema_test.py ROOT; exits with 77 (skipped) without jsonschema (tools/install-deps)
"""
import json
import pathlib
import re
import sys

try:
    import jsonschema
except ImportError:
    print("skipped: jsonschema is not installed; tools/install-deps installs it")
    sys.exit(77)

ROOT = pathlib.Path(sys.argv[1])
schema = json.loads((ROOT / "docs/edit.schema.json").read_text())
jsonschema.Draft7Validator.check_schema(schema)
validator = jsonschema.Draft7Validator(schema)
failures = []


def check(edit, is_valid, where):
    errors = [error.message for error in validator.iter_errors(edit)]
    if bool(errors) == is_valid:
        failures.append(f"{where}: {errors[0] if errors else 'the schema accepts it'}: {json.dumps(edit)}")


examples = re.findall(r"```json\n(.*?)```", (ROOT / "docs/editing.md").read_text(), re.DOTALL)
assert examples, "docs/editing.md has no example"
for example in examples:
    check(json.loads(example), True, "docs/editing.md")
cases = json.loads((ROOT / "tests/tools/edit_cases.json").read_text())
for edit in cases["accepted"]:
    check(edit, True, "accepted")
for case in cases["rejected"]:
    edit = {"format": "v3d-edit", "version": 1, "operations": [case["operation"]]}
    check(edit, case.get("schema_accepts", False), case["message"])
for edit in ({}, {"format": "v3d-scene", "version": 1, "operations": []}, {"format": "v3d-edit", "version": 2, "operations": []},
             {"format": "v3d-edit", "version": 1, "operations": [], "name": "turn"},
             {"format": "v3d-edit", "version": 1, "operations": [{"do": "mirror"}] * 1001}):
    check(edit, False, "no edit")
# Each operation and key that the table of the page names is one of the schema, and the reverse.
operations = (ROOT / "docs/editing.md").read_text().split("| `do` |")[1].split("## ")[0]
table = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", operations, re.MULTILINE))
of_schema = {one["properties"]["do"]["const"]: set(one["properties"]) - {"do"} for one in schema["definitions"]["operation"]["oneOf"]}
of_page = {name: set(re.findall(r"`(\w+)`", keys)) for name, keys in table.items()}
if of_schema != of_page:
    failures.append(f"the schema has {of_schema}, the page {of_page}")
print("\n".join(failures))
sys.exit(bool(failures))
