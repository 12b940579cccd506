"""Build and install phil_loop (ament_python): the loop, the ride, the studies and the benches."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "phil_loop"
VERSION = ElementTree.parse(Path(__file__).with_name("package.xml")).findtext("version")

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(exclude=["build*", "lib*", "test*"]),
    package_data={"faults": ["*.c"], "validate": ["*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest", "hypothesis"]},
    zip_safe=False,
    maintainer="phil-catenary maintainers",
    maintainer_email="maintainers@example.org",
    description="The closed loop as a library, the ride by nodes, studies, benches and examinations.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["ride = ride.__main__:main"]},
)
