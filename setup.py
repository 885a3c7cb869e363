"""Build step: the demo drive, which stands in ``recordings/``, becomes a part of the package."""

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithDemo(build_py):
    """Copies the demo drive into the package that is built; an editable install reads it there."""

    def run(self) -> None:
        """Build the package, then add the drive."""
        super().run()
        if not self.editable_mode:
            self.copy_file("recordings/demo.mcap", f"{self.build_lib}/roadeval/demo.mcap")


setup(cmdclass={"build_py": BuildWithDemo})
