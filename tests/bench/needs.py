"""What a script of this folder needs: it is installed where that is possible, and named where it is not."""
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
os.environ["NODAL_OVERWRITE"] = "1"  # a script's runs follow each other with the same outputs


def installed(packages):
    """Installs what is missing of a list of .setup; ends the script when that is not possible."""
    done = subprocess.run([ROOT / ".setup" / "install", packages])
    if done.returncode != 0:
        sys.exit(f"{sys.argv[0]} needs what .setup/packages-{packages} names; the lines above say why it is not there")


def built(build, *programs):
    """The paths of programs in a build folder; ends the script when one is not there."""
    paths = [build.resolve() / "bin" / program for program in programs]
    missing = [path.name for path in paths if not path.exists()]
    if missing:
        sys.exit(f"{sys.argv[0]} needs {', '.join(missing)} in {build.resolve() / 'bin'}; build with:\n"
                 f"    .setup/install && cmake --preset release && cmake --build build/release --target {' '.join(missing)}")
    return paths
