"""Says where the packages lie; all else is in pyproject.toml.

The shipped configs live in `configs/`, where people look for them, and install as `weathercoat/configs`.
"""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["weathercoat*"]), "weathercoat.configs"],
    package_dir={"weathercoat.configs": "configs"},
)
