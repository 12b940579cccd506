from pathlib import Path

from setuptools import setup

package = "impedance_mpc"

setup(
    name=package,
    version="0.1.0",
    packages=[package],
    package_data={package: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        (f"share/{package}/config", sorted(map(str, Path("config").glob("*.yaml")))),
        (f"share/{package}/config/identified", sorted(map(str, Path("config/identified").glob("*.yaml")))),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="phil-catenary maintainers",
    maintainer_email="maintainers@example.org",
    description="Model predictive impedance controller of the pantograph test rig",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"{package} = {package}.node:main"]},
)
