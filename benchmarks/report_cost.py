"""What a report costs: seconds of processor time, beside a program that draws one empty figure.

Make the artifacts of a study first (`make reproduce` does), then

    python benchmarks/report_cost.py configs/paper.yaml data/paper/{trajectory,flight,selection,model,prediction}.h5
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

REPEATS = 3
EMPTY = "import io, matplotlib.figure as m; f = m.Figure(); f.subplots(); f.savefig(io.BytesIO(), format='svg')"


def main(config: Path, *artifacts: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        outputs = {form: Path(folder) / f"report.{form}" for form in ("html", "md", "json")}
        calls = {"one empty figure": [sys.executable, "-c", EMPTY]} | {
            f"report, {form}": [*cpfls(), "report", config, *artifacts, "-o", output, "--force", "-q"]
            for form, output in outputs.items()
        }
        for call in calls.values():
            processor_seconds(call)
        # In turn, so that a busy machine is busy for all of them.
        times = [{name: processor_seconds(call) for name, call in calls.items()} for _ in range(REPEATS)]
        sizes = {f"report, {form}": output.stat().st_size / 1e6 for form, output in outputs.items()}
    rows = []
    for name in calls:
        own = [time[name] for time in times]
        ratio = median(time[name] / time["one empty figure"] for time in times)
        rows.append((name, median(own), ratio, sizes.get(name, "")))
    columns = ("what", "processor time, s", "times the empty figure", "megabytes")
    table("report_cost", columns, rows, artifacts=[path.name for path in artifacts])


def cpfls() -> list[str]:
    return [sys.executable, "-m", "cpfls_cli"]


def processor_seconds(call) -> float:
    """Run a program; give the processor time that it took, its own and that of the system for it."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in call], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
