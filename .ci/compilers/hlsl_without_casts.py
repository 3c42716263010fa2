#!/usr/bin/env python3
"""HLSL in which every cast of 0 to an array is written as a list, for a front end that does not know it."""
import re
import sys

with open(sys.argv[1]) as file:
    text = file.read()
# An array that exists already is written element by element.
loop = r"\1for (uint zero = 0; zero < \3; zero++) { \2[zero] = 0; }"
text = re.sub(r"(^|[{;]\s*)(\w+) = \(\w+\[(\d+)\]\)0;", loop, text, flags=re.M)
print(re.sub(r"\(\w+\[(\d+)\]\)0", lambda cast: "{" + ", ".join(["0"] * int(cast.group(1))) + "}", text))
