"""Runs the Python examples of docs/python.md and docs/domains.md in one namespace; those that need matplotlib where it
is there.
"""

import os
import re
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def examples() -> list[str]:
    """The blocks of code of the pages. That of the README is the first of them."""
    blocks = [
        re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text("utf-8"), re.DOTALL | re.MULTILINE)
        for page in ("README.md", "docs/python.md", "docs/domains.md")
    ]
    assert blocks[0] == blocks[1][:1], "the example of the README is not the first of docs/python.md"
    return blocks[1] + blocks[2]


def main() -> None:
    with tempfile.TemporaryDirectory() as directory:
        os.chdir(directory)
        Path("studies").symlink_to(ROOT / "studies")
        names: dict[str, object] = {}
        for number, example in enumerate(examples(), 1):
            if "matplotlib" in example and find_spec("matplotlib") is None:
                print(f"example {number}: left out, there is no matplotlib")
                continue
            print(f"example {number}:", flush=True)
            exec(compile(example, f"docs/python.md, example {number}", "exec"), names)


if __name__ == "__main__":
    sys.exit(main())
