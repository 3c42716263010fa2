#!/usr/bin/env python3
"""Kernels as NVIDIA's compiler makes them: nvidia_code.py FOLDER ARCHITECTURE... (sm_90 is H100 and H200).

Reads every FOLDER/*.metal of `pipelines`, compiles it as CUDA C++ with the header beside this file
(no fused multiply-add, approximate division, as Vulkan has it), and writes the machine code to FOLDER/nvidia-ARCHITECTURE.
Prints rows `device,kernel,statistic,value`. Vulkan's driver has another front end before the same back end, so counts are
near those of a device, not equal. Needs the PyPI packages nvidia-cuda-nvrtc and nvidia-cuda-nvdisasm.
"""
import ctypes
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nvidia


def package_file(pattern):
    """A file of NVIDIA's packages."""
    for root in nvidia.__path__:
        for path in Path(root).rglob(pattern):
            return path
    raise SystemExit(f"{pattern}: not in NVIDIA's packages; install nvidia-cuda-nvrtc and nvidia-cuda-nvdisasm")


def cuda_source(metal, header):
    """The MSL of a kernel as CUDA C++ with a wrapper, because a kernel takes no references."""
    body = metal.split("using metal::uint;", 1)[1]
    body = re.sub(r"\[\[.*?\]\]", "", body)
    # A literal without a suffix is a double in C++.
    body = re.sub(r"(?<![\w.])(\d+\.\d+(?:e[+-]?\d+)?)(?![\w.])", r"\1f", body)
    body = re.sub(r"^constant ", "constexpr ", body, flags=re.M)
    # CUDA has vectors of the same names.
    body = re.sub(r"(?<![\w:])(uint[234]|float[24])\b", r"metal::\1", body)
    signature = re.search(r"kernel void (\w+)\((.*?)\) \{", body, re.S)
    entry, parameters = signature.group(1), [p.strip() for p in signature.group(2).split(",")]
    pointers, arguments, shared = [], [], ""
    for parameter in parameters:
        kind, name = parameter.rsplit(" ", 1)
        if kind.startswith("threadgroup"):
            shared += f"    __shared__ {kind.strip('&')} {name};\n"
            arguments.append(name)
        elif kind.endswith("&"):
            pointers.append(f"{kind[:-1]} *{name}")
            arguments.append(f"*{name}")
        else:
            builtin = {"group": "blockIdx", "groups": "gridDim"}.get(name)
            arguments.append(f"metal::uint3{{{builtin}.x, {builtin}.y, {builtin}.z}}" if builtin else "threadIdx.x")
    wrapper = f'extern "C" __global__ __launch_bounds__(64) void {entry}_of({", ".join(pointers)}) {{\n'
    return f"{header}\n{body}\n{wrapper}{shared}    {entry}({', '.join(arguments)});\n}}\n"


class Compiler:
    """NVIDIA's run-time compiler."""

    def __init__(self):
        library = package_file("libnvrtc.so.*")
        self.nvrtc = ctypes.CDLL(str(library))

    def compile(self, source, name, architecture):
        """Machine code and log of a source."""
        program = ctypes.c_void_p()
        create = self.nvrtc.nvrtcCreateProgram
        self.check(create(ctypes.byref(program), source.encode(), name.encode(), 0, None, None), name, "")
        options = [f"-arch={architecture}", "-fmad=false", "-prec-div=false", "-default-device", "-std=c++17",
                   "--ptxas-options=-v", "-w"]
        texts = (ctypes.c_char_p * len(options))(*[o.encode() for o in options])
        status = self.nvrtc.nvrtcCompileProgram(program, len(options), texts)
        log = self.text(program, "ProgramLog")
        self.check(status, name, log)
        size = ctypes.c_size_t()
        self.check(self.nvrtc.nvrtcGetCUBINSize(program, ctypes.byref(size)), name, log)
        code = ctypes.create_string_buffer(size.value)
        self.check(self.nvrtc.nvrtcGetCUBIN(program, code), name, log)
        self.nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
        return code.raw, log

    def text(self, program, what):
        size = ctypes.c_size_t()
        getattr(self.nvrtc, f"nvrtcGet{what}Size")(program, ctypes.byref(size))
        text = ctypes.create_string_buffer(size.value)
        getattr(self.nvrtc, f"nvrtcGet{what}")(program, text)
        return text.value.decode()

    def check(self, status, name, log):
        if status != 0:
            raise SystemExit(f"{name}: NVIDIA's compiler refuses it ({status})\n{log}")


def main(folder, architectures):
    header = (Path(__file__).parent / "metal.cuh").read_text()
    compiler, disassembler = Compiler(), package_file("nvdisasm")

    def rows(task):
        """Writes the machine code of a kernel; returns its rows."""
        architecture, path = task
        out, kernel = folder / f"nvidia-{architecture}", path.name.removesuffix(".metal")
        code, log = compiler.compile(cuda_source(path.read_text(), header), kernel, architecture)
        binary = out / f"{kernel}.cubin"
        binary.write_bytes(code)
        listing = subprocess.run([disassembler, "-c", binary], check=True, capture_output=True, text=True).stdout
        (out / f"{kernel}.assembly").write_text(listing)
        registers = int(re.search(r"Used (\d+) registers", log).group(1))
        spilled = sum(int(n) for n in re.findall(r"(\d+) bytes spill (?:stores|loads)", log))
        stack = int(re.search(r"(\d+) bytes stack frame", log).group(1))
        statistics = (("Registers", registers), ("Spilled bytes", spilled), ("Stack bytes", stack))
        return [f"nvidia-{architecture},{kernel},{statistic},{value}" for statistic, value in statistics]

    for architecture in architectures:
        (folder / f"nvidia-{architecture}").mkdir(exist_ok=True)
    tasks = [(architecture, path) for architecture in architectures for path in sorted(folder.glob("*.metal"))]
    print("device,kernel,statistic,value")
    # The compiler and the disassembler run outside Python's lock.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for of_kernel in pool.map(rows, tasks):
            print("\n".join(of_kernel))


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]), sys.argv[2:])
