"""A whole study: fly, judge, forget the logs; what is done already is not done again."""

from __future__ import annotations

import json
import shutil
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from benchmarks.blind_study.fly import fly
from benchmarks.blind_study.judge import judge

CASES_AT_ONCE = 24


class Progress:
    """A line on stderr with the time left."""

    def __init__(self, done, total):
        self.first, self.done, self.total, self.started = done, done, total, time.monotonic()

    def step(self):
        """Take note of one more set."""
        self.done += 1
        spent = time.monotonic() - self.started
        left = spent / (self.done - self.first) * (self.total - self.done)
        end = "\n" if self.done == self.total or not sys.stderr.isatty() else ""
        if sys.stderr.isatty() or self.done % 20 == 0 or self.done == self.total:
            print(
                f"\r{self.done} of {self.total} sets, {left // 3600:.0f} h {left // 60 % 60:02.0f} min left ",
                end=end,
                file=sys.stderr,
                flush=True,
            )


def run(groups, folder, processes, keep=False):
    """Fly and judge a study, a list of sets for each case; what is said goes to ``results.jsonl`` of its folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    done = judged(folder)
    progress = Progress(sum(each.name in done for own in groups for each in own), sum(map(len, groups)))
    left = [own for own in ([each for each in own if each.name not in done] for own in groups) if own]
    parts = [left[start : start + CASES_AT_ONCE] for start in range(0, len(left), CASES_AT_ONCE)]
    with ProcessPoolExecutor(processes) as pool, (folder / "results.jsonl").open("a", encoding="utf-8") as results:
        coming = [pool.submit(fly, part, folder) for part in parts[:1]]
        for place in range(len(parts)):
            logs = coming.pop().result()
            # The next flights are flown while these are judged.
            coming = [pool.submit(fly, part, folder) for part in parts[place + 1 : place + 2]]
            _judge_in(pool, logs, results, progress, keep)


def judge_all(folder, processes, again=()):
    """Judge all flights of a folder that are not judged yet; or those of some sets alone, by their names, and again."""
    folder = Path(folder)
    if again:
        (folder / "results.jsonl").unlink(missing_ok=True)
    done = judged(folder)
    names = again or sorted(path.name for path in (folder / "flights").iterdir())
    logs = [folder / "flights" / name for name in names if name not in done]
    with ProcessPoolExecutor(processes) as pool, (folder / "results.jsonl").open("a", encoding="utf-8") as results:
        _judge_in(pool, logs, results, Progress(len(done), len(done) + len(logs)), keep=True)


def _judge_in(pool, logs, results, progress, keep):
    asked = {pool.submit(judge, path): path for path in logs}
    for future in as_completed(asked):
        print(json.dumps(future.result()), file=results, flush=True)
        progress.step()
        if not keep:
            shutil.rmtree(asked[future])


def judged(folder):
    """List the sets that have a result; half a line, of a run that was stopped, is taken off."""
    path = folder / "results.jsonl"
    if not path.exists():
        return set()
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return {json.loads(line)["set"] for line in whole.splitlines()}
