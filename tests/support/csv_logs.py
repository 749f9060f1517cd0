"""CSV logs as a rig writes them."""

import numpy as np

PHASE = np.repeat(np.arange(0, 4 * np.pi, 0.25), 2)  # each phase twice, as rigs log them
LOOP = {
    "phase_rad": PHASE,
    "command_deg": 60 * np.sin(PHASE) + np.tile([-0.5, 0.5], len(PHASE) // 2),
    "angle_deg": 30 * np.sin(PHASE - 0.3),
    "tension_a_n": 5 + 3 * np.sin(PHASE),
    "tension_b_n": 5 - 3 * np.sin(PHASE),
}


def write(folder, columns, name="log.csv"):
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


def steps(**columns):
    """Four samples, one second apart; what is given stands instead of, or next to, the other columns."""
    given = {"time_s": [0, 1, 2, 3], "command_deg": [0, 1, 2, 1], "angle_deg": [0, 0.5, 1, 0.75]} | columns
    return {name: values for name, values in given.items() if values is not None}
