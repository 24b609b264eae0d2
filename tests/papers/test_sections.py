"""The titles and times of every paper's sections, which the progress bar needs."""

from __future__ import annotations

import pytest

from cmg_mj.papers import BEYOND, PAPERS, sections_of


@pytest.mark.parametrize("paper", [*PAPERS, *BEYOND])
def test_sections_have_titles_and_times(paper: str) -> None:
    sections = sections_of(paper)
    assert len({section.title for section in sections}) == len(sections)
    assert all(section.title and section.seconds > 0.0 for section in sections)
