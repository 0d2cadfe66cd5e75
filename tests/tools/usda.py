"""A reader of the USD text that v3dctl writes: a list of stage metadata, and attributes with time samples."""
import json
import re


class Usda:
    def __init__(self, path):
        with open(path) as file:
            lines = file.read().splitlines()
        assert lines[0] == "#usda 1.0", lines[0]
        self.metadata, self.samples = {}, {}
        attribute = None
        for number, line in enumerate(lines[1:], 2):
            sample = re.fullmatch(r"\s+(\d+): (\[.*\]),", line)
            opened = re.fullmatch(r"\s+(\S+) (\S+)\.timeSamples = \{", line)
            setting = re.fullmatch(r"\s+(?:uniform token )?(\w+) = (.+)", line)
            if opened:
                assert attribute is None, f"{path}:{number}: {attribute} is not closed"
                attribute = opened[2]
                self.samples[attribute] = {}
            elif sample:
                values = json.loads(sample[2].replace("(", "[").replace(")", "]"))
                self.samples[attribute][int(sample[1])] = values
            elif line.strip() == "}":
                attribute = None
            elif setting:
                self.metadata[setting[1]] = json.loads(setting[2])
            else:
                assert re.fullmatch(r'\s*(def \w+ "\w+"|[(){]|color3f\[\] primvars:displayColor \(|)', line), f"{path}:{number}: {line}"

    def times(self):
        return sorted(self.samples["points"])

    def at(self, attribute, time):
        """The value that holds at a time: that of the last sample up to it."""
        samples = self.samples[attribute]
        return samples[max(key for key in samples if key <= time)]
