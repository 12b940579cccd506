"""Environment variables of ROS 2 that a start would fail on, or take for something else: named before it.

The middleware ends a process that it does not find its library for (code 102, while rclpy is imported), and reads
numbers and switches so generously that a slip of the pen puts a rig onto another domain or onto the network.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import re
import socket
import struct
import sys
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

SIOCGIFADDR = 0x8915
WRONG = 2
"""Exit code."""
LAST_DOMAIN = 232
"""From this domain on the ports of DDS would be beyond 65535."""
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
BY_PROFILE = "SYSTEM_DEFAULT"
RANGES = ("SUBNET", "LOCALHOST", BY_PROFILE)
ONLY_HERE = "ROS_LOCALHOST_ONLY"
SWITCHES = (
    "ROS_LOCALHOST_ONLY",
    "RCUTILS_COLORIZED_OUTPUT",
    "RCUTILS_LOGGING_USE_STDOUT",
    "RCUTILS_LOGGING_BUFFERED_STREAM",
)
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
THIS_MACHINE = Path(__file__).with_name("this_machine.xml")
"""Profile of Fast DDS that listens on 127.0.0.1 only, and not in the shared memory of DDS."""
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
OF_TRANSPORTS = ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", TRANSPORTS, *PROFILES)
"""Variables by which a user says who is to be heard: with one of them the profile is left out."""


def leave_if_unusable() -> None:
    """End the process with code 2 and one line for everything that cannot work; else keep it to this machine."""
    found = list(complaints(os.environ))
    if found:
        print("\n".join(found), file=sys.stderr)
        sys.exit(WRONG)
    keep_to_this_machine(os.environ)


def keep_to_this_machine(environment: MutableMapping[str, str]) -> None:
    """Let nobody on the network find or reach the nodes, unless the environment says who may.

    A discovery range of LOCALHOST makes nobody look for others, but with it alone Fast DDS still listens on every
    address, and who names this machine in ROS_STATIC_PEERS gets in: the sockets are bound to 127.0.0.1 as well, by a
    profile. rmw_fastrtps adds its own transports to those of a profile for the range LOCALHOST, shared memory among
    them, and takes them from the profile alone for SYSTEM_DEFAULT; the profile itself says then who is looked for.

    Args:
        environment: of the process, before rclpy is imported; what it inherits.
    """
    given = {name for name, value in environment.items() if value}
    if environment.get(ONLY_HERE) != "1" and RANGE not in given:
        environment[RANGE] = "LOCALHOST"
    local = environment.get(RANGE) == "LOCALHOST" or environment.get(ONLY_HERE) == "1"
    if local and given.isdisjoint(OF_TRANSPORTS):
        environment[PROFILES[0]] = str(THIS_MACHINE)
        environment[RANGE] = BY_PROFILE
        if ONLY_HERE in given:
            environment[ONLY_HERE] = "0"  # it counts as LOCALHOST
    elif not local and given.isdisjoint(OF_TRANSPORTS):
        environment[TRANSPORTS] = "UDPv4"  # all addresses, and no shared memory either


def reach(environment: Mapping[str, str]) -> str:
    """Say in one line who can find nodes with that environment, empty for this machine alone."""
    given = {name: value for name, value in environment.items() if value}
    peers = given.get("ROS_STATIC_PEERS", "").replace(";", ", ")
    if given.get(ONLY_HERE) == "1" or given.get(PROFILES[0]) == str(THIS_MACHINE):
        return ""
    if given.get(RANGE, RANGES[0]) != "LOCALHOST":
        return (
            f"open to the network: everybody on ROS domain {given.get('ROS_DOMAIN_ID', '0')} can move the drive, at "
            f"{', '.join(addresses()) or 'no address of this machine'}"
        )
    if peers or set(given) & set(OF_TRANSPORTS):
        return (
            f"open to {peers or 'whom the settings of Fast DDS let in'}, and to everybody who names an address of this "
            f"machine as a peer ({', '.join(addresses())}): they can move the drive"
        )
    return ""


def addresses() -> list[str]:
    """Give the IPv4 addresses of this machine's network interfaces, without the loopback."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode()[:15])
            with suppress(OSError):  # an interface without an address
                answer = fcntl.ioctl(asking.fileno(), SIOCGIFADDR, request)
                found.append(socket.inet_ntoa(answer[20:24]))
    return sorted(address for address in found if not address.startswith("127."))


def complaints(environment: Mapping[str, str]) -> Iterator[str]:
    """Give a line for each variable that is wrong: what it is, what it may be, what to do.

    Args:
        environment: of the process; an empty variable counts as none, as for ROS.
    """
    given = {name: value for name, value in environment.items() if value}
    yield from _middleware(given)
    yield from _domain(given)
    for name in SWITCHES:
        if given.get(name, "0") not in ("0", "1"):
            yield f"{name}={given[name]}: has to be 0 or 1"
    discovery = given.get("ROS_AUTOMATIC_DISCOVERY_RANGE", RANGES[0])
    if discovery == "OFF":
        yield "ROS_AUTOMATIC_DISCOVERY_RANGE=OFF: the nodes would not find each other; set it to LOCALHOST or SUBNET"
    elif discovery not in RANGES:
        yield f"ROS_AUTOMATIC_DISCOVERY_RANGE={discovery}: has to be one of {', '.join(RANGES)}, in capitals"
    if given.get("RMW_IMPLEMENTATION", "rmw_fastrtps").startswith("rmw_fastrtps"):
        for name in PROFILES:
            yield from _profiles(name, given)
        yield from _peers(given)
    yield from _keys(given)
    yield from _logs(given)


def _middleware(given: Mapping[str, str]) -> Iterator[str]:
    name = given.get("RMW_IMPLEMENTATION")
    if name is None:
        return
    try:
        ctypes.CDLL(f"lib{name}.so")
    except (OSError, ValueError) as error:
        there = installed(given)
        package = f"ros-{given.get('ROS_DISTRO', 'jazzy')}-{name.replace('_', '-')}"
        advice = f"unset RMW_IMPLEMENTATION, or install {package}"
        if name in there:
            advice += f" anew ({error})"
        yield f"RMW_IMPLEMENTATION={name}: it is not there (there: {', '.join(there) or 'none'}); {advice}"


def installed(given: Mapping[str, str]) -> list[str]:
    """Give the names of the middlewares that are installed, by the index of ROS packages and the path of libraries."""
    prefixes = [Path(prefix) for prefix in given.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    places = [Path(place) for place in given.get("LD_LIBRARY_PATH", "").split(os.pathsep) if place]
    entries = (
        entry.name
        for prefix in prefixes
        for entry in (prefix / "share/ament_index/resource_index/rmw_typesupport").glob("rmw_*")
    )
    libraries = (path.stem.removeprefix("lib") for place in places for path in place.glob("librmw_*_cpp.so"))
    no_middlewares = re.compile("rmw_implementation|.*(_shared_|__).*")
    return sorted({name for name in (*entries, *libraries) if not no_middlewares.fullmatch(name)})


def _domain(given: Mapping[str, str]) -> Iterator[str]:
    text = given.get("ROS_DOMAIN_ID", "0")
    # ROS takes 010 for 8, 4x for 4 and -1 for none.
    if not re.fullmatch("0|[1-9][0-9]{0,2}", text) or int(text) > LAST_DOMAIN:
        yield f"ROS_DOMAIN_ID={text}: has to be a whole number from 0 to {LAST_DOMAIN}"


def _profiles(name: str, given: Mapping[str, str]) -> Iterator[str]:
    """Fast DDS goes on without a file that it cannot read: with other settings than the user believes."""
    path = given.get(name)
    if path is None:
        return
    try:
        ElementTree.parse(path)
    except OSError as error:
        yield f"{name}={path}: cannot be read ({error.strerror}); correct the path or unset it"
    except ElementTree.ParseError as error:
        yield f"{name}={path}: is no XML ({error}); correct the file or unset it"


def _peers(given: Mapping[str, str]) -> Iterator[str]:
    """A node cannot be created while one of the peers has no address."""
    for peer in filter(None, given.get("ROS_STATIC_PEERS", "").split(";")):
        try:
            socket.getaddrinfo(peer, None)
        except (OSError, UnicodeError):
            yield f"ROS_STATIC_PEERS: {peer!r} has no address; give names or addresses with ';' between them"


def _keys(given: Mapping[str, str]) -> Iterator[str]:
    # ROS takes every other word for no, and goes on without any protection.
    for name, words in (
        ("ROS_SECURITY_ENABLE", ("true", "false")),
        ("ROS_SECURITY_STRATEGY", ("Enforce", "Permissive")),
    ):
        if given.get(name, words[0]) not in words:
            yield f"{name}={given[name]}: has to be {' or '.join(words)}, written so"
    if given.get("ROS_SECURITY_ENABLE") != "true":
        return
    if not _secured(given):
        yield (
            "ROS_SECURITY_ENABLE=true: the Fast DDS that is installed was built without its security plugins (as in "
            "the wheels of ROS 2 Jazzy): source a ROS 2 Jazzy from apt, or unset it"
        )
        return
    if given.get("ROS_SECURITY_STRATEGY") != "Enforce":
        return
    folder = given.get("ROS_SECURITY_KEYSTORE", "")
    if not Path(folder).is_dir() or not folder:
        yield f"ROS_SECURITY_KEYSTORE={folder}: is no folder, but ROS_SECURITY_STRATEGY=Enforce needs the keys in it"


def _secured(given: Mapping[str, str]) -> bool:
    """Tell whether Fast DDS has its security plugins; True where it is another middleware, or not to be found."""
    if not given.get("RMW_IMPLEMENTATION", "rmw_fastrtps").startswith("rmw_fastrtps"):
        return True
    places = (Path(place) for place in given.get("LD_LIBRARY_PATH", "").split(os.pathsep) if place)
    library = next((place / "libfastrtps.so" for place in places if (place / "libfastrtps.so").is_file()), None)
    return library is None or _AUTHENTICATION in library.read_bytes()


_AUTHENTICATION = b"PKI-DH"
"""Part of the name of the plugin that lets participants prove who they are, in the library that has it."""


def _logs(given: Mapping[str, str]) -> Iterator[str]:
    """ROS makes the folder of its logs itself, and ends the process where it cannot."""
    home = Path(given.get("ROS_HOME", "~/.ros"))
    place = Path(given.get("ROS_LOG_DIR", home / "log"))
    try:
        place = place.expanduser()
        place.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(place, os.W_OK | os.X_OK) else "not writable"
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
    if reason:
        yield f"ROS cannot write its logs into {place} ({reason}): set ROS_LOG_DIR to a folder that can be written"
