"""python -m render2mpeg: runs the program with the same arguments."""

import subprocess
import sys

from . import Error, program

if __name__ == "__main__":
    try:
        sys.exit(subprocess.run([program(), *sys.argv[1:]], check=False).returncode)
    except Error as error:
        sys.exit(f"render2mpeg: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
