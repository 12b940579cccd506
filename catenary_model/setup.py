"""Build and install catenary_model (ament_python)."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "catenary_model"
VERSION = ElementTree.parse(Path(__file__).with_name("package.xml")).findtext("version")

setup(
    name=PACKAGE,
    version=VERSION,
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "config/*.yaml", "lines/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", [str(path) for path in sorted(Path(PACKAGE, "config").glob("*.yaml"))]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest", "hypothesis"]},
    zip_safe=False,
    maintainer="phil-catenary maintainers",
    maintainer_email="maintainers@example.org",
    description="Catenary in the moving frame of the train, by finite elements or differences; absorbing boundaries.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"{PACKAGE} = {PACKAGE}.node:main"]},
)
