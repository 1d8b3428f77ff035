"""The page of a run, live: a server on this machine alone that takes the user's edits."""

from twin.view.server import Server as Server
from twin.view.server import serving as serving
