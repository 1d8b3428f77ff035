"""Independent readers of exported files, one per engine.

They run in a process of the engine's own Python, which may hold nothing but numpy and the engine: nothing
here imports the rest of this project. `run.py` is started as a file: python -I run.py ENGINE REQUEST ANSWER.

The request is a JSON list of jobs: {path, format, parts (names), states (n, parts), state (parts,), position
(parts,), velocity (parts,), times (t,)}. The answer is one JSON line per job, written as it is done, so that
a crash costs one file: {parts {name: measured}, warnings [...], error text or null, version, seconds}.

Measured are, in the world at state 0: parent (name of the link, "" for the world), type, axis, pivot, lower,
upper, mass, com, inertia (3 x 3 about the com), motion (n, 4, 4), the motion from state 0 to every row of
`states`; and what the engine has of damping, frictionloss, armature, friction (of contact: lowest and highest
of its shapes), bounds (2, 3) of the visual mesh, mass_diagonal (its entry of the joint-space mass matrix at
`state`), rollout (t,) (its joint from `position` with `velocity`, pulled by gravity and held back by its
damping; no contacts, limits or dry friction), collision (greatest depth while opening).
"""
