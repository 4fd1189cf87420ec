"""Builds itmo_video/kernels where there is a C compiler; without one everything works, slower."""

from __future__ import annotations

import os
import shlex
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# Every machine is to give the same bytes: no fused multiplication, no other order of sums.
FLOATS = ["-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS = ["-O3", "-std=c11", *FLOATS, "-shared", "-fPIC"]


class NativeHook(BuildHookInterface[Any]):
    """Puts the library into the package, where an editable installation finds it, too."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile; what goes wrong is said and leaves the library out."""
        package = Path(self.root, "itmo_video")
        sources = sorted(str(path) for path in package.glob("kernels/*.c"))
        target = package / "kernels" / "_native.so"
        target.unlink(missing_ok=True)
        compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
        # The second without what not every compiler and C library can do.
        for extra in ([], ["-DITMO_ONE_TARGET"]):
            command = [*compiler, *FLAGS, *extra, *sources, "-o", str(target), "-lm"]
            try:
                done = subprocess.run(command, capture_output=True, text=True)
                reason = done.stderr.strip()
            except OSError as error:
                reason = str(error)
            if target.exists():
                build_data["artifacts"].append("itmo_video/kernels/_native.so")
                build_data["pure_python"] = False
                build_data["tag"] = "py3-none-" + _platform_tag()
                return
        self.app.display_warning(f"itmo_video without its compiled loops: {reason}")


def _platform_tag() -> str:
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")
