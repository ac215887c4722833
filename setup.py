"""The one thing pyproject.toml cannot say beside a search for packages: the data folder has another name installed."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["core*", "stripe_gui*"]), "stripe_resources"],
    package_dir={"stripe_resources": "resources"},
)
