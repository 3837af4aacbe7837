"""The machine that measures, as far as it tells."""

import os
import platform
from pathlib import Path


def description() -> dict:
    model = platform.processor() or platform.machine()
    flags = ""
    cpus = Path("/proc/cpuinfo")
    if cpus.exists():
        for line in cpus.read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                model = value.strip()
            if key.strip() == "flags":
                flags = value
            # All processors of a machine are the same.
            if model and flags:
                break
    widest = "AVX-512" if " avx512f" in flags else "AVX2" if " avx2" in flags else ""
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "vector_registers": widest,
        "system": platform.system(),
    }
