"""Units of what a part weighs and how it resists; imports nothing, so that the command line answers at once."""

UNITS = {
    "mass": "kg",
    "friction": "1 (sliding friction coefficient)",
    "damping": "N m s/rad for a hinge, N s/m for a slide",
    "frictionloss": "N m for a hinge, N for a slide",
}
