#!/usr/bin/env python3
"""HLSL in which every cast of 0 to an array is written as a list, for a front end that does not know it."""
import re
import sys

with open(sys.argv[1]) as file:
    text = file.read()
print(re.sub(r"\(\w+\[(\d+)\]\)0", lambda cast: "{" + ", ".join(["0"] * int(cast.group(1))) + "}", text))
