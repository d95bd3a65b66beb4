"""What tests of table scripts that read a driver's rows and traces share."""
import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path


class TablesTestCase(unittest.TestCase):
    """Runs ci/NAME_tables on `raw` and `traces`; its NAME.md is `text`, all it writes is in `out`."""
    name = None
    raw = None
    traces = None

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = Path(folder.name)
        (self.out / "raw.json").write_text(json.dumps(self.raw))
        (self.out / "traces.json").write_text(json.dumps(self.traces))
        script = Path(__file__).resolve().parent / f"{self.name}_tables"
        subprocess.run([sys.executable, script, self.out / "raw.json", "--out", self.out,
                        "--traces", self.out / "traces.json"], check=True)
        self.text = (self.out / f"{self.name}.md").read_text()
