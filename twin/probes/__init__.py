"""Independent readers of exported files. Each runs in a process of its own: python -m twin.probes REQUEST ANSWER.

The request is JSON: consumer, files {format: path}, parts (names) and states (n, parts). The answer is JSON:
format -> {"parts": {name: measured}, "warnings": [...], "error": text or null}. Measured are, in the world at state 0:
type, axis, pivot, lower, upper, mass, com, inertia (3 x 3 about the com) and motion (n, 4, 4), the motion from state 0;
where the consumer reads them damping, frictionloss, bounds of the visual mesh, and collision (greatest depth while opening).
"""
