"""What the compiled module needs of a system."""

import re
import subprocess
import sys

import pytest

import driftmesh


@pytest.mark.skipif(sys.platform != "linux", reason="manylinux is about Linux")
def test_the_module_needs_no_library_that_manylinux_lacks():
    def dump(what):
        command = ["objdump", what, driftmesh._driftmesh.__file__]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    needed = set(re.findall(r"NEEDED\s+(\S+)", dump("-p")))
    versions = re.findall(r"\(GLIBC_(\d+)\.(\d+)", dump("-T"))
    major, minor = max((int(a), int(b)) for a, b in versions)
    print(f"suits manylinux_{major}_{minor} and newer")
    assert "libc.so.6" in needed and (2, 14) <= (major, minor)
    assert {name for name in needed if not re.match(r"(libc|libm|libgcc_s|libpthread|libdl|ld-linux)\b", name)} == set()
