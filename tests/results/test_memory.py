"""Memory that is free in the process goes back to the system."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

PROGRAM = """
from cmg_mj.results.memory import release_free_memory

def resident_mb():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) // 1024 for line in file if line.startswith("VmRSS"))

blocks = [bytearray(64_000) for _ in range(1000)]  # 64 MB, each small enough to come from the heap
last = blocks.pop()  # holds the heap's end in place
blocks.clear()
before = resident_mb()
release_free_memory()
print(before - resident_mb())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator than glibc's")
def test_what_is_free_below_the_heaps_end_goes_back() -> None:
    process = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert int(process.stdout) > 40
