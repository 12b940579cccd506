#!/usr/bin/env bash
# rmw_fastrtps_cpp 8.4.3 with Fast DDS 2.14.5 (ros-jazzy-rclpy 7.1.6): with discovery limited to the own host, the
# transports that a profile or FASTDDS_BUILTIN_TRANSPORTS name are not the ones that are used
#
# The documentation of Fast DDS gives two ways to choose transports without code: FASTDDS_BUILTIN_TRANSPORTS=UDPv4, and
# a default participant profile with useBuiltinTransports false and the userTransports that are wanted. With
# ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST (said to limit who is discovered) rmw_fastrtps switches the builtin transports
# off and adds its own shared memory and UDP to the participant's list. So the variable does nothing, and a profile
# with UDP on 127.0.0.1 alone gets shared memory, and sockets on other addresses as well. Nothing is logged. With
# SUBNET or SYSTEM_DEFAULT both settings hold.
#
# Seen (threads of shared memory, UDP sockets that are not on 127.0.0.1):
#   SYSTEM_DEFAULT, UDPv4 by the variable     no,  yes
#   LOCALHOST, UDPv4 by the variable          yes, yes
#   SYSTEM_DEFAULT, the profile               no,  no
#   LOCALHOST, the profile                    yes, yes
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq "ros-jazzy-rclpy[fastrtps]==7.1.6" numpy==2.2.6 || exit 2
export ROS_LOG_DIR="$temp" ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-77}"
cat >"$temp/profile.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com">
  <transport_descriptors>
    <transport_descriptor>
      <transport_id>loopback</transport_id>
      <type>UDPv4</type>
      <interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
    </transport_descriptor>
  </transport_descriptors>
  <participant profile_name="loopback" is_default_profile="true">
    <rtps>
      <builtin>
        <metatrafficUnicastLocatorList><locator/></metatrafficUnicastLocatorList>
        <initialPeersList><locator><udpv4><address>127.0.0.1</address></udpv4></locator></initialPeersList>
      </builtin>
      <userTransports><transport_id>loopback</transport_id></userTransports>
      <useBuiltinTransports>false</useBuiltinTransports>
    </rtps>
  </participant>
</profiles>
XML
cat >"$temp/look.py" <<'PY'
import re
from pathlib import Path

import rclpy

rclpy.init()
node = rclpy.create_node("node", start_parameter_services=False, enable_rosout=False)
threads = [(task / "comm").read_text() for task in Path("/proc/self/task").iterdir()]
links = [str(fd.readlink()) for fd in Path("/proc/self/fd").iterdir() if fd.is_symlink()]
inodes = {found[1] for found in map(re.compile(r"socket:\[(\d+)\]").fullmatch, links) if found}
rows = [row.split() for row in Path("/proc/self/net/udp").read_text().splitlines()[1:]]
addresses = {row[1].split(":")[0] for row in rows if row[9] in inodes}
print(any(name.startswith("dds.shm") for name in threads), bool(addresses - {"0100007F"}))
node.destroy_node()
rclpy.shutdown()
PY
"$temp/venv/bin/python" - "$temp" <<'PY'
import os
import subprocess
import sys

temp = sys.argv[1]
variable = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
profile = {"FASTRTPS_DEFAULT_PROFILES_FILE": f"{temp}/profile.xml"}
as_stated = True
for setting, by in ((variable, "the variable"), (profile, "the profile")):
    for reach, expected in (("SYSTEM_DEFAULT", f"False {setting is variable}"), ("LOCALHOST", "True True")):
        environment = {**os.environ, **setting, "ROS_AUTOMATIC_DISCOVERY_RANGE": reach}
        command = [sys.executable, f"{temp}/look.py"]
        seen = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()
        print(f"{reach:15} by {by:12}  shared memory, other addresses: {seen}")
        as_stated &= seen == expected
sys.exit(0 if as_stated else 1)
PY
