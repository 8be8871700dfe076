"""Tables in narrow terminals: every number is whole, and stands beside the name of its row."""

from __future__ import annotations

import io

import pytest
from rich.text import Text

from sysid_ros.cli.output import _Terminal, table

NAMES = ("lbr_iiwa_joint_1", "lbr_iiwa_joint_2")
CELLS = [[f"{row}.{k}234 ± 0.0{row}{k}" for k in range(6)] for row in (1, 2)]


def shown(width: int) -> str:
    """A table of six columns of numbers and one of words, as a terminal shows it."""
    out = table("Joints, with 95 % intervals", "joint", *(f"c{k}\nN m" for k in range(6)), "missed", words=["missed"])
    for name, cells in zip(NAMES, CELLS, strict=True):
        out.add_row(name, *cells, Text("not identifiable beside the dry friction, which makes most of it"))
    file = io.StringIO()
    console = _Terminal(file=file, width=width)
    console.print(out)
    console.print("below")
    return file.getvalue()


@pytest.mark.parametrize("width", [40, 50, 80, 100, 130, 200])
def test_every_number_is_whole(width: int) -> None:
    lines = shown(width).splitlines()
    assert max(map(len, lines)) <= width
    assert "…" not in "".join(lines)
    for name, cells in zip(NAMES, CELLS, strict=True):
        rows = [line for line in lines if name in line]
        assert len(rows) == len([line for line in lines if line.strip().startswith("joint")])
        assert all(sum(cell in row for row in rows) == 1 for cell in cells)
    assert all(any(word in line for line in lines) for word in ("identifiable", "beside", "friction,", "most"))
    assert lines[-1] == "below"


def test_one_table_where_it_fits() -> None:
    assert shown(200).count("lbr_iiwa_joint_1") == 1
    assert shown(80).count("lbr_iiwa_joint_1") == 3
    assert shown(80).count("with 95 % intervals") == 1
