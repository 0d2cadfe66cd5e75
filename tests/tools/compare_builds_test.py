"""Tests that tools/bench/compare-builds compares all benchmarks whose names stay. Run with the source folder."""
import importlib.machinery
import importlib.util
import pathlib
import re
import sys

sys.dont_write_bytecode = True
path = str(pathlib.Path(sys.argv[1]) / "tools/bench/compare-builds")
spec = importlib.util.spec_from_loader("compare_builds", importlib.machinery.SourceFileLoader("compare_builds", path))
compare_builds = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compare_builds)

NAMES = """segment/15xXGA/threads:2 intersect/8mm/threads:2 intersect/5mm/threads:2 intersect/2mm/threads:2 mesh/8mm mesh/5mm
texture/10mm deform/5mm encode/10mm decode/10mm live/10mm/threads:2 live_medium/10mm/threads:2 high/5mm/threads:2
raster/depth_15xXGA match/frames record/15xXGA""".split()
missing = [name for name in NAMES if not re.search(compare_builds.CONTRACT, name)]
assert not missing, f"not compared: {missing}"
