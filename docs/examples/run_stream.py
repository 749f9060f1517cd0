"""Drive `endotwin run` from another program, in any Python: no package of EndoTwin is imported here.

    python run_stream.py endotwin run --policy runs/ram_twins/policy.onnx

It pulls to and fro, measures with noise, and prints what comes back. In place of `pull_mm` and
`measurement_deg` below, put the command of your drive and the angle of your sensor.
"""

import json
import math
import random
import subprocess
import sys

SAMPLE_TIME = 0.1  # [s], that of the training unless --sample-time states another


def main() -> int:
    """Send a hundred samples, one after the answer to the other; returns the exit status of the command."""
    noise = random.Random(1)
    with subprocess.Popen(
        sys.argv[1:], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    ) as estimator:
        for k in range(100):
            time_s = SAMPLE_TIME * k
            pull_mm = 2.0 * math.sin(time_s)
            measurement_deg = 40.0 * math.sin(time_s - 0.3) + noise.gauss(0.0, 0.3)
            if k % 10 == 9:
                measurement_deg = None  # the sensor said nothing: leave it out, or send null
            sample = {"time_s": time_s, "pull_mm": pull_mm, "measurement_deg": measurement_deg}
            estimator.stdin.write(json.dumps(sample) + "\n")
            estimator.stdin.flush()
            line = estimator.stdout.readline()  # exactly one answer for each line
            if not line:
                break  # it has ended, and said why on stderr
            answer = json.loads(line)
            if "error" in answer:
                print(f"line {answer['line']}: {answer['error']}", file=sys.stderr)
                continue
            low, high = answer["interval_deg"] or (math.nan, math.nan)
            faults = answer["health"]["sample"] + answer["health"]["alarms"]
            print(
                f"{answer['time_s']:6.2f} s  {answer['bend_deg']:8.3f} deg  [{low:.3f}, {high:.3f}]  "
                f"{answer['source']}  {' '.join(faults)}"
            )
        estimator.stdin.close()  # the end of the stream: it closes its recording, and sums up on stderr
    return estimator.returncode


if __name__ == "__main__":
    sys.exit(main())
