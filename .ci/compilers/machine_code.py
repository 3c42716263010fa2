#!/usr/bin/env python3
"""What compilers made of the kernels: machine_code.py FOLDER CSV... [--check] [--out CSV].

FOLDER is the output folder of `pipelines`, the CSV files are what that benchmark and nvidia_code.py
printed. Prints one row per device and kernel: registers, spills, instructions, fused operations, and instructions of one
step: on the shortest way through the loop, and with all branches. --check fails on a spill, on more registers than the
budget, and on a fused operation that can change a result.
"""
import argparse
import collections
import csv
import heapq
import json
import math
import re
import struct
import sys
from pathlib import Path

# Registers per lane, at most. Above 64, an SM of sm_90 holds less than half of its warps; two vehicles need more.
BUDGET = {"generator": 80, "tally": 96, "cut-out": 96, "other": 64}

INSTRUCTION = re.compile(r"^\s*(?:/\*[0-9a-f]+\*/)?\s*(?:(@!?U?P\w+)\s+)?([A-Za-z][\w.]*)\s*(.*?)\s*(?:;.*)?$")
LABEL = re.compile(r"^(BB\d+|\.L_x_\d+):?$")
TARGET = re.compile(r"(BB\d+|\.L_x_\d+)\b")


class Instruction:
    """One line of a listing."""

    def __init__(self, guard, name, operands):
        self.guard, self.name, self.operands = guard, name, operands

    def is_branch(self):
        return self.name == "BRA" or self.name.startswith(("s_branch", "s_cbranch"))

    def is_conditional(self):
        return self.guard is not None or self.name.startswith("s_cbranch")

    def kind(self):
        """Class of the unit that computes it; None for what costs no slot."""
        name = self.name
        if name.startswith(("s_delay", "s_waitcnt", "s_clause", "s_nop", "s_wait", "s_set_", "s_code_end")):
            return None
        if name.startswith("v_"):
            slow = ("v_rcp", "v_sqrt", "v_mul_lo_u32", "v_mul_hi", "v_mul_lo", "v_cvt_f64")
            return "special" if name.startswith(slow) else "vector"
        if name.startswith("s_"):
            return "scalar"
        if name.startswith(("buffer_", "global_", "scratch_", "ds_", "flat_")):
            return "memory"
        if name.startswith(("LD", "ST", "RED", "ATOM")) and name.split(".")[0] not in ("LDC",):
            return "memory"
        if name.startswith(("MUFU", "F2I", "F2F", "FLO", "POPC", "BREV")):
            return "special"
        if name.startswith(("FADD", "FMUL", "FFMA", "IMAD", "NOP")) and ".HI" not in name and ".WIDE" not in name:
            return "full"
        return "half"


def listing(path):
    """Instructions of a listing and the place of each label."""
    code, labels = [], {}
    for line in path.read_text().splitlines():
        label = LABEL.match(line.strip())
        if label:
            labels[label.group(1)] = len(code)
            continue
        if not line.startswith(("\t", " ")) or line.strip().startswith((".", "//")):
            continue
        # Where Mesa has no disassembler for a chip it lists its own form, with the results in front.
        found = INSTRUCTION.match(line.split(" = ", 1)[1] if " = " in line else line)
        if found and not found.group(2).startswith("."):
            code.append(Instruction(*found.groups()))
    return code, labels


class Loop:
    """The instructions that a lane repeats, step by step. A compiler may put several steps into one pass."""

    def __init__(self, code, labels, step_cap):
        self.code = code
        # One comparison with the last step marks a step.
        last = re.compile(rf"\b(?:0x)?(?:{step_cap:x}|{step_cap - 1:x}|{step_cap}|{step_cap - 1})\b")
        compares = ("ISETP", "UISETP", "v_cmp", "s_cmp", "v_cmpx")
        # Where a comparison takes no constant, a register holds it.
        held = {c.operands.split(",")[0].strip() for c in code
                if c.name.startswith(("s_mov", "v_mov")) and last.search(c.operands)}
        holds = [bool(held.intersection(re.split(r"[,\s]+", c.operands))) for c in code]
        self.marks = [c.name.startswith(compares) and (bool(last.search(c.operands)) or of)
                      for c, of in zip(code, holds)]
        self.next = []
        for at, instruction in enumerate(code):
            target = TARGET.search(instruction.operands) if instruction.is_branch() else None
            to = labels.get(target.group(1)) if target else None
            falls = not instruction.is_branch() or instruction.is_conditional()
            ends = instruction.name in ("EXIT", "RET.REL.NODEC", "s_endpgm") and instruction.guard is None
            self.next.append([n for n in ([to] if to is not None else []) + ([at + 1] if falls and not ends else [])
                              if n < len(code)])
        before = collections.defaultdict(list)
        for at, nexts in enumerate(self.next):
            for to in nexts:
                before[to].append(at)
        loops = collections.defaultdict(set)
        for at, nexts in enumerate(self.next):
            for head in nexts:
                if head <= at:
                    inside, open_ = {head, at}, [at]
                    while open_:
                        here = open_.pop()
                        for other in before[here] if here != head else []:
                            if other not in inside:
                                inside.add(other)
                                open_.append(other)
                    loops[head] |= inside
        stepping = [(len(inside), head) for head, inside in loops.items() if any(self.marks[at] for at in inside)]
        if not stepping:
            raise SystemExit("no loop compares with the last step")
        _, self.head = min(stepping)
        self.inside = loops[self.head]

    def cost(self, at):
        return 0 if self.code[at].kind() is None else 1

    def least(self):
        """Instructions of a step on the shortest way round."""
        best, queue = {}, [(0, self.head, 0)]
        shortest = None
        while queue:
            spent, at, steps = heapq.heappop(queue)
            if best.get((at, steps), spent + 1) <= spent:
                continue
            best[at, steps] = spent
            spent, steps = spent + self.cost(at), steps + self.marks[at]
            for to in self.next[at]:
                if to == self.head and steps:
                    shortest = min(shortest or math.inf, spent / steps)
                elif to in self.inside and steps < 16:
                    heapq.heappush(queue, (spent, to, steps))
        return shortest

    def most(self):
        """Instructions of a step with every branch."""
        return sum(self.cost(at) for at in self.inside) / sum(self.marks[at] for at in self.inside)

    def kinds(self):
        """Instructions of a step with every branch, by kind."""
        steps = sum(self.marks[at] for at in self.inside)
        counts = collections.Counter(self.code[at].kind() for at in self.inside)
        return {kind: count / steps for kind, count in counts.items() if kind is not None}


def is_power_of_two(operand):
    """Whether an operand is a number whose products are exact. AMD writes other numbers than the usual ones as bits."""
    number = re.fullmatch(r"-?(0x[0-9a-f]{8}|\d+(?:\.\d+)?(?:e[+-]?\d+)?)", operand)
    if not number:
        return False
    text = number.group(1)
    value = struct.unpack(">f", bytes.fromhex(text[2:]))[0] if text.startswith("0x") else float(text)
    return math.frexp(value)[0] == 0.5


def factors(instruction):
    """The two factors of a fused operation. A listing may leave the result out; a sum is then one operand more."""
    operands = [operand.strip() for operand in instruction.operands.split(",")]
    sources = operands[1:] if re.fullmatch(r"[vR]\d+", operands[0].removesuffix(".reuse")) else operands
    # v_fmamk: factor, number, sum.
    return sources[:2]


def fused(code):
    """Fused multiply-adds that can change a result, harmless ones, and unfused ones in one instruction."""
    harmful, harmless, unfused = [], 0, 0
    for instruction in code:
        name = instruction.name
        if re.match(r"(v_(fma|fmac|fmaak|fmamk|pk_fma|dual_fma|fma_mix)|FFMA|HFMA2)", name) and "_u" not in name:
            # HFMA2.MMA and FFMA with zero operands move constants.
            moves = name.startswith("HFMA2") and "RZ" in instruction.operands
            # An exact product: the sum is rounded once either way.
            if moves or any(is_power_of_two(factor) for factor in factors(instruction)):
                harmless += not moves
            else:
                harmful.append(f"{name} {instruction.operands}")
        elif re.match(r"v_(mad|mac|madak|madmk)_f32", name):
            unfused += 1
    return harmful, harmless, unfused


def statistics_of(paths):
    facts = collections.defaultdict(dict)
    for path in paths:
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                device = "-".join(re.findall(r"[A-Za-z0-9_]+", row["device"])).lower()
                facts[device, row["kernel"]][row["statistic"]] = row["value"]
    return facts


def table(folder, facts):
    rows = []
    for (device, kernel), fact in sorted(facts.items()):
        path = folder / device / f"{kernel}.assembly"
        if not path.exists():
            raise SystemExit(f"{path}: no machine code; run the benchmark with --out {folder}")
        code, labels = listing(path)
        constants = json.loads((folder / f"{kernel}.constants.json").read_text())
        loop = Loop(code, labels, int(constants["frame_step_cap"])) if "frame_step_cap" in constants else None
        harmful, harmless, unfused = fused(code)
        number = lambda *names: sum(int(fact.get(name, 0)) for name in names)
        rows.append({
            "device": device,
            "kernel": kernel,
            "registers": number("VGPRs", "Registers"),
            "spilled": number("Spilled SGPRs", "Spilled VGPRs", "Spilled bytes"),
            "scratch_bytes": number("Scratch size", "Stack bytes"),
            "instructions": sum(i.kind() is not None for i in code),
            "fused": len(harmful),
            "fused_exact": harmless,
            "unfused_mad": unfused,
            "step_least": round(loop.least(), 1) if loop else "",
            "step_most": round(loop.most(), 1) if loop else "",
            "half_rate": round(loop.kinds().get("half", 0), 1) if loop else "",
            "harmful": harmful,
        })
    return rows


def check(rows):
    wrong = []
    for row in rows:
        place = f"{row['device']}, {row['kernel']}"
        name = row["kernel"].split(".")[0]
        part = name if name in BUDGET else "cut-out" if ".cut-out." in row["kernel"] else "other"
        if row["spilled"]:
            wrong.append(f"{place}: {row['spilled']} spilled (registers or bytes); none is allowed")
        if row["registers"] > BUDGET[part]:
            wrong.append(f"{place}: {row['registers']} registers, at most {BUDGET[part]} for {part}")
        wrong += [f"{place}: a fused operation changes results: {text}" for text in row["harmful"]]
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("csv", nargs="+")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--out")
    options = parser.parse_args()
    rows = table(options.folder, statistics_of(options.csv))
    columns = list(rows[0])[:-1]
    print(" ".join(f"{c:>13}" if k > 1 else f"{c:28}" for k, c in enumerate(columns)))
    for row in rows:
        print(" ".join(f"{row[c]:13}" if k > 1 else f"{row[c]:28}" for k, c in enumerate(columns)))
    if options.out:
        with open(options.out, "w", newline="") as file:
            writer = csv.DictWriter(file, columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    if options.check:
        wrong = check(rows)
        for line in wrong:
            print(line, file=sys.stderr)
        sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
