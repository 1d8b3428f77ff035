"""What pyproject.toml can't say: assets/ is installed as twin/_assets. Everything else stands there."""

from setuptools import find_namespace_packages, find_packages, setup

SHIPPED = ["twin._assets", *(f"twin._assets.{folder}" for folder in find_namespace_packages("assets"))]

setup(
    packages=[*find_packages(include=["twin*", "recon*", "robots*"]), *SHIPPED],
    package_dir={"twin._assets": "assets"},
)
