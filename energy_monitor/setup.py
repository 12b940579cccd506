"""Build and install energy_monitor (ament_python)."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "energy_monitor"
VERSION = ElementTree.parse(Path(__file__).with_name("package.xml")).findtext("version")

setup(
    name=PACKAGE,
    version=VERSION,
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "config/*.yaml", "report/*.html", "report/*.j2", "report/*.css"]},
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
    description="Audit of a ride: energy, momentum, contact quality, completeness; recording and report.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            f"{PACKAGE} = {PACKAGE}.node:main",
            f"record = {PACKAGE}.record:main",
            f"analyze = {PACKAGE}.report.cli:main",
        ]
    },
)
