"""The page of a run, `report.html`: one file with the scene, the recording, and what the verbs found."""

from twin.page.page import render as render
