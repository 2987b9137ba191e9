"""The program ``driftmesh``, which the package installs; ``python -m driftmesh`` is the same."""

import sys

from ._driftmesh import program


def main() -> int:
    return program(["driftmesh", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
