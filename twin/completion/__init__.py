"""What no camera saw of furniture, inferred from what one did: boards closed as boxes, drawers with sides and back, cabinets, handles.

The seen meshes stay as they are; what is inferred stands beside them (twin.inferred), each piece with its reason, and exports write
one layer or both. A part without a flat front is left as it was seen: nothing is inferred of what is not understood.

The seam for a learned model is `infer` (twin/completion/infer.py): whatever gives the same layer for a twin can stand in its place.
"""

from __future__ import annotations

from twin.completion.asset import is_reconstructed
from twin.inferred import VERSION
from twin.scene import Twin


def with_completion(twin: Twin) -> Twin:
    """The twin with the inferred layer of its static scene and every part, collision shapes included; itself where it has one that the
    program of today inferred.

    A twin that was not made from a recording was stated by somebody, whole as it is: nothing is inferred.
    """
    if not (is_reconstructed(twin) and twin.parts) or has_completion(twin):
        return twin
    from twin.completion.infer import infer  # SciPy and Open3D, which a wrong option needs not wait for
    from twin.completion.shapes import with_shapes

    return with_shapes(infer(twin))


def has_completion(twin: Twin) -> bool:
    """Whether all of a twin has an inferred layer that the program of today inferred."""
    layers = [twin.static.completion, *(p.completion for p in twin.parts)]
    return all(k is not None and k.version == VERSION for k in layers)
