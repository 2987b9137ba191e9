"""Runs the Python examples of the README, section by section of its own; those that need matplotlib where it is there."""

import os
import re
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def examples() -> list[str]:
    """The blocks of code in the section "Python"."""
    text = (ROOT / "README.md").read_text("utf-8")
    section = re.search(r"^## Python\n(.*?)^## ", text, re.DOTALL | re.MULTILINE)
    assert section, "the README has no section Python"
    return re.findall(r"^```python\n(.*?)^```", section.group(1), re.DOTALL | re.MULTILINE)


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
            exec(compile(example, f"README.md, example {number}", "exec"), names)


if __name__ == "__main__":
    sys.exit(main())
