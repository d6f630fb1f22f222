"""Nothing lost, nothing broken in: hostile files of every format, and runs that are killed at any
moment.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

from .case import Group, Log, Verdict

LOST = Group("nothing lost")
GROUPS = (LOST,)
FILES, KILLS, SEED = 1000, 50, 1


def _hostile(_: Log, count: int) -> Verdict:
    from .fuzzing import fuzz

    formats = fuzz(count, SEED)
    total = {
        name: int(sum(one[name] for one in formats.values())) for name in ("inputs", "refused", "failed")
    }
    slowest = max(one["slowest_s"] for one in formats.values())
    said = f"{total['inputs']} files of {len(formats)} formats, {total['refused']} refused"
    return not total["failed"], f"{said}, {total['failed']} failed, slowest {slowest:.1f} s"


def _killed(_: Log, count: int) -> Verdict:
    from .killing import kills

    with tempfile.TemporaryDirectory() as folder:
        found = kills(count, SEED, Path(folder))
    lost = int(found["broken"] + found["fields_lost"])
    apart = found["largest_difference"]
    good = found["kills"] >= count and not lost and apart <= 1e-9
    same = f"{found['same_to_the_last_digit']:.0f} of {found['rounds']:.0f} runs the same to the last digit"
    return good, f"{found['kills']:.0f} kills, {lost} files lost or broken, forces within {apart:.0e}, {same}"


LOST.case(
    f"{FILES} hostile files of each format", "read, or refused with one sentence; no traceback, no code run"
)(partial(_hostile, count=FILES))
LOST.case(f"{KILLS} kills", "resumed runs equal the uninterrupted one to 1e-9 of the largest force")(
    partial(_killed, count=KILLS)
)
