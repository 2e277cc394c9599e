"""C for a microcontroller, with nothing of libm beyond sin, cos and sqrt: `python examples/06_c.py`.

Needs gcc. Prints:
    compiled with -std=c99 -Wall -Wextra -Werror
    10 clearances, smallest 5.800 mm (beta_9)
"""

import subprocess
import tempfile
from pathlib import Path

import pinbound as pb

MAIN = """#include <stdio.h>
#include "arm.h"
int main(void)
{
    const double q[ARM_COORDINATES] = {0.0, 0.0, 0.0};
    double h[ARM_BOUNDARIES], J[ARM_BOUNDARIES * ARM_COORDINATES];
    int i, least = 0;
    arm_clearances_and_jacobian(q, h, J);
    for (i = 1; i < ARM_BOUNDARIES; ++i)
        if (h[i] < h[least]) least = i;
    printf("%d %.3f", least, 1e3 * h[least]);
    return 0;
}
"""
robot = pb.load("minervabot_v3")
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    source, _ = robot.export("c", folder / "arm.c")
    (folder / "main.c").write_text(MAIN)
    options = ["-std=c99", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["gcc", *options, "main.c", source.name, "-lm", "-o", "main"], cwd=folder, check=True)
    print("compiled with", *options)
    said = subprocess.run([str(folder / "main")], capture_output=True, text=True, check=True).stdout.split()
print(f"{len(robot.boundaries)} clearances, smallest {said[1]} mm ({robot.boundaries.names[int(said[0])]})")
