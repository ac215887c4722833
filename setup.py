"""What pyproject.toml cannot say: the data folder has another name installed, and the description stands alone."""

import re
from pathlib import Path

from setuptools import find_packages, setup

README = (Path(__file__).parent / "README.md").read_text(encoding="utf-8")
# pictures and links that lead into this folder
INNER = r"!\[[^\]]*\]\((?!https?:)[^)]*\)\n*|\[([^\]]*)\]\((?!https?:)[^)]*\)"

setup(
    packages=[*find_packages(include=["core*", "stripe_gui*"]), "stripe_resources"],
    package_dir={"stripe_resources": "resources"},
    long_description=re.sub(INNER, lambda link: link[1] or "", README),
    long_description_content_type="text/markdown",
)
