"""What pyproject.toml can't say: assets/ is installed as twin/_assets. Everything else stands there.

An editable install (`pip install -e .`) names the checkout in a .pth file, which type checkers read; assets/
are found there as they lie. With a package from another folder setuptools would install an import hook
instead, which type checkers don't run.
"""

import sys

from setuptools import find_namespace_packages, find_packages, setup

PACKAGES = find_packages(include=["twin*", "recon*", "robots*"])
SHIPPED = ["twin._assets", *(f"twin._assets.{folder}" for folder in find_namespace_packages("assets"))]

if "editable_wheel" in sys.argv:
    setup(packages=PACKAGES, package_dir={"": "."})
else:
    setup(packages=[*PACKAGES, *SHIPPED], package_dir={"twin._assets": "assets"})
