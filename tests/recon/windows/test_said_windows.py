"""The user's word picks windows, and its frames are those of the window."""

from __future__ import annotations

import numpy as np

from recon.recording.said import Said
from recon.windows.said_windows import said_windows
from recon.windows.windows import Window

TIMES = np.arange(600) / 10.0
WINDOWS = (Window(50, 150, (80, 120)), Window(300, 420, (330, 390)))


def test_without_a_word_all_windows_are_solved() -> None:
    said = Said(up="-y")
    assert said_windows(WINDOWS, said, TIMES) == [(w, said) for w in WINDOWS]


def test_a_word_goes_to_its_window_and_counts_from_its_first_frame() -> None:
    told = said_windows(WINDOWS, Said(("--at 3,4@350 --interval 340:380 --type hinge",)), TIMES)
    assert told[0] == (WINDOWS[0], Said()), "a word is of its window alone"
    assert told[1] == (WINDOWS[1], Said(("--at 3,4@50 --interval 40:80 --type hinge",)))


def test_words_on_several_windows_are_told_apart_with_their_types() -> None:
    said = Said(("--interval 340:380 --type hinge", "--interval 85:110 --type slide"), up="-y")
    (first, of_first), (second, of_second) = said_windows(WINDOWS, said, TIMES)
    assert (first, second) == WINDOWS
    assert of_first == Said(("--interval 35:60 --type slide",), up="-y")
    assert of_second == Said(("--interval 40:80 --type hinge",), up="-y")


def test_a_word_on_frames_in_which_nothing_was_seen_gets_a_window() -> None:
    told = said_windows(WINDOWS, Said(("--interval 200:230",)), TIMES)
    assert [w for w, _ in told] == [WINDOWS[0], Window(170, 260, (200, 230)), WINDOWS[1]]
    assert [word.parts for _, word in told] == [(), ("--interval 30:60",), ()]
    (window, word) = said_windows(WINDOWS, Said(("--at 3,4@500",)), TIMES)[-1]
    assert window.first < 500 < window.last
    assert word.parts == (f"--at 3,4@{500 - window.first}",)
