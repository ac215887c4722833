"""What pyproject.toml cannot say: the data folder's installed name, a description that stands alone, equal builds.

With STRIPE_KERNELS, a folder made by `packaging/kernels.py`, a wheel holds these kernels and is of this platform.
"""

import gzip
import json
import os
import re
import shutil
import sys
import tarfile
from email.parser import Parser
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.sdist import sdist

sys.path.insert(0, str(Path(__file__).parent / "packaging"))
from bill import of_wheel

README = (Path(__file__).parent / "README.md").read_text(encoding="utf-8")
# pictures and links that lead into this folder
INNER = r"!\[[^\]]*\]\((?!https?:)[^)]*\)\n*|\[([^\]]*)\]\((?!https?:)[^)]*\)"
os.umask(0o022)  # whoever builds


class EqualWheel(bdist_wheel):
    """The files of a wheel have the same rights, whoever has checked them out."""

    kernels = os.environ.get("STRIPE_KERNELS")

    def finalize_options(self):
        """Say that compiled kernels are of one Python and processor."""
        super().finalize_options()
        self.root_is_pure = not self.kernels

    def egg2dist(self, egginfo_path, distinfo_path):
        """Write the metadata, when all else is there, and the bill of materials where PEP 770 has it."""
        super().egg2dist(egginfo_path, distinfo_path)
        metadata = Parser().parsestr((Path(distinfo_path) / "METADATA").read_text(encoding="utf-8"))
        listed = Path(distinfo_path) / "sboms/stripe-workbench.cdx.json"
        listed.parent.mkdir()
        listed.write_text(json.dumps(of_wheel(metadata), indent=1) + "\n", encoding="utf-8")
        if self.kernels:
            shutil.copytree(self.kernels, Path(self.bdist_dir) / "core/kernels")
        for path in Path(self.bdist_dir).rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)


class EqualArchive(sdist):
    """An archive of the sources has the time that SOURCE_DATE_EPOCH says, and nobody's name."""

    def make_archive(self, base_name, format, root_dir=None, base_dir=None, owner=None, group=None):
        """Write the archive."""
        moment = os.environ.get("SOURCE_DATE_EPOCH")
        if moment is None or format != "gztar":
            return super().make_archive(base_name, format, root_dir, base_dir, owner, group)

        def plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
            member.mtime, member.mode = int(moment), 0o755 if member.isdir() else 0o644
            member.uid = member.gid = 0
            member.uname = member.gname = ""
            return member

        name = f"{base_name}.tar.gz"
        with gzip.GzipFile(name, "wb", mtime=int(moment)) as file, tarfile.open(fileobj=file, mode="w") as archive:
            archive.add(base_dir, filter=plain)
        return name


setup(
    packages=[*find_packages(include=["core*", "stripe_gui*"]), "stripe_resources"],
    package_dir={"stripe_resources": "resources"},
    long_description=re.sub(INNER, lambda link: link[1] or "", README),
    long_description_content_type="text/markdown",
    cmdclass={"bdist_wheel": EqualWheel, "sdist": EqualArchive},
)
