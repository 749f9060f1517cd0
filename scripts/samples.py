"""`endotwin samples`: copy the sample logs and a tiny dataset that ship with the package."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from scripts.command import Summary, run_verb
from scripts.outputs import output_folder


@dataclasses.dataclass(frozen=True)
class Samples:
    """Copy the sample logs and a tiny dataset that ship with EndoTwin into a folder.

    With them the commands of the documents can be tried as they are printed. All are simulated: none was
    measured on a real endoscope.
    """

    out: Path = Path(".")
    """Folder to copy them into."""
    seed: int = 0
    """Nothing is drawn by chance; here for uniformity."""
    json: bool = False
    """Print the summary as one JSON object."""


def samples(args: Samples) -> Summary:
    """Copy the files."""
    from twin.samples.copy import SAMPLES, copy_samples

    paths = copy_samples(output_folder(args.out))
    table = "\n".join(f"  {name:<22} {what}" for name, what in SAMPLES.items())
    line = f"{args.out}: {len(paths)} files, all simulated: none was measured on a real endoscope"
    return Summary(line, {"out": str(args.out), "files": [str(path) for path in paths]}, table=table)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Samples, samples, argv)


if __name__ == "__main__":
    sys.exit(main())
