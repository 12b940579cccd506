from pathlib import Path
from xml.etree import ElementTree

from setuptools import setup

package = "impedance_mpc"
version = ElementTree.parse(Path(__file__).with_name("package.xml")).findtext("version")

setup(
    name=package,
    version=version,
    packages=[package],
    package_data={package: ["py.typed", "config/*.yaml", "config/identified/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        (f"share/{package}/config", sorted(map(str, Path(package, "config").glob("*.yaml")))),
        (f"share/{package}/config/identified", sorted(map(str, Path(package, "config", "identified").glob("*.yaml")))),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest", "hypothesis"]},
    zip_safe=True,
    maintainer="phil-catenary maintainers",
    maintainer_email="maintainers@example.org",
    description="Model predictive impedance controller of the pantograph test rig",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"{package} = {package}.node:main"]},
)
