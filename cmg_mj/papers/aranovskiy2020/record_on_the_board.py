"""`python -m cmg_mj.papers.aranovskiy2020.record_on_the_board` writes what `on_the_board.py` reads."""

from __future__ import annotations

import json

from cmg_mj.papers.aranovskiy2020.on_the_board import RECORDED, count
from cmg_mj.results.files import whole_file

if __name__ == "__main__":
    with whole_file(RECORDED) as temporary:
        temporary.write_text(json.dumps(count(), indent=2) + "\n", encoding="utf-8")
