"""Installs the package test_rig_sim for ament_python."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "test_rig_sim"
VERSION = ElementTree.parse(Path(__file__).with_name("package.xml")).findtext("version")

setup(
    name=NAME,
    version=VERSION,
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "config/*.yaml", "config/rigs/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", [str(path) for path in Path(NAME, "config").glob("*.yaml")]),
        (f"share/{NAME}/config/rigs", [str(path) for path in Path(NAME, "config", "rigs").glob("*.yaml")]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest", "hypothesis"]},
    zip_safe=False,
    maintainer="phil-catenary maintainers",
    maintainer_email="maintainers@example.org",
    description="Simulated pantograph test rig",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"{NAME} = {NAME}.node:main"]},
)
