#!/usr/bin/env python3
"""What compilers made of the kernels: machine_code.py FOLDER CSV... [--steps CSV] [--check] [--out CSV].

FOLDER is the output folder of `pipelines`, the CSV files are what that benchmark and nvidia_code.py
printed. Prints one row per device and kernel: registers, spills, instructions, fused operations, instructions of one
pass of the step loop. --check fails on a spill, on more registers than the budget, and on a fused operation that can
change a result. --steps adds the predicted lane-steps per second from the steps of a study (`pipelines --steps`), and
--measured the rows of `--bench device` beside them.
"""
import argparse
import collections
import csv
import math
import re
import sys
from pathlib import Path

# Registers per lane, at most. Above 64, an SM of sm_90 holds less than half of its warps; two vehicles need more.
BUDGET = {"generator": 80, "cut-out": 96, "other": 64}

# Chips: multiprocessors (or compute units), clock in Hz, lanes per clock and unit of each class of instructions.
# NVIDIA: CUDA C++ Programming Guide, "Throughput of Native Arithmetic Instructions", compute capability 8.9 and 9.0.
# AMD: RDNA 3 ISA guide: two SIMD32 per compute unit, quarter rate for quotients and wide integer products.
NVIDIA_RATES = {"issue": 128, "half": 64, "special": 16, "memory": 32}
AMD_RATES = {"vector": 64, "special": 16, "scalar": 64, "memory": 32}
CHIPS = {
    "H100 SXM": ("nvidia-sm_90", 132, 1.755e9, NVIDIA_RATES),
    "H200 SXM": ("nvidia-sm_90", 132, 1.83e9, NVIDIA_RATES),
    "RTX 4070 laptop": ("nvidia-sm_89", 36, 2.0e9, NVIDIA_RATES),
    "RX 7900 XTX": ("null-hardware-radv-navi31", 96, 2.5e9, AMD_RATES),
}

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


def step_loop(code, labels):
    """First and last instruction of the largest loop: one pass is one step of a lane."""
    largest = None
    for at, instruction in enumerate(code):
        target = TARGET.search(instruction.operands) if instruction.is_branch() else None
        begin = labels.get(target.group(1)) if target else None
        if begin is not None and begin <= at and (largest is None or at - begin > largest[1] - largest[0]):
            largest = (begin, at)
    return largest


def mix(code, labels, span):
    """Instructions of a loop by kind: those of every pass, those of a pass with all branches, those after a lane's end."""
    begin, end = span
    skippable, ending, left = [False] * (end + 1), [False] * (end + 1), False
    for at in range(begin, end + 1):
        ending[at] = ending[at] or left
        target = TARGET.search(code[at].operands) if code[at].is_branch() else None
        to = labels.get(target.group(1)) if target else None
        # What follows a jump back to the first instruction is there for lanes that have ended.
        left = left or (to == begin and code[at].is_conditional())
        # A branch over instructions: a pass may skip them. One that leaves the loop skips nothing of this pass.
        if to is not None and at < to <= end and (code[at].is_conditional() or skippable[at]):
            for k in range(at + 1, to):
                skippable[k] = True
            # Only a lane that has ended takes the next one of its workgroup.
            takes = any(code[k].name.startswith(("ATOMS", "ds_add", "ds_append")) for k in range(at + 1, to))
            if takes and 2 * (to - at) < 3 * (end - begin) // 2:
                for k in range(at + 1, to):
                    ending[k] = True
    least, most, once = collections.Counter(), collections.Counter(), collections.Counter()
    for at in range(begin, end + 1):
        kind = code[at].kind()
        if kind is not None:
            once[kind] += ending[at]
            most[kind] += not ending[at]
            least[kind] += not ending[at] and not skippable[at]
    return least, most, once


def fused(code):
    """Fused multiply-adds that can change a result, harmless ones, and unfused ones in one instruction."""
    harmful, harmless, unfused = [], 0, 0
    for instruction in code:
        name = instruction.name
        if re.match(r"(v_(fma|fmac|fmaak|fmamk|pk_fma|dual_fma|fma_mix)|FFMA|HFMA2)", name) and "_u" not in name:
            # HFMA2.MMA and FFMA with zero operands move constants.
            factors = re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.])", instruction.operands)
            moves = name.startswith("HFMA2") and "RZ" in instruction.operands
            # A factor that is a power of two makes the product exact, so that the sum is rounded once either way.
            if moves or any(f and float(f) != 0 and math.frexp(abs(float(f)))[0] == 0.5 for f in factors[:1]):
                harmless += not moves
            else:
                harmful.append(f"{name} {instruction.operands}")
        elif re.match(r"v_(mad|mac|madak|madmk)_f32", name):
            unfused += 1
    return harmful, harmless, unfused


def clocks(counts, rates):
    """Clocks of one unit per invocation for these instructions, and what limits it."""
    if "issue" in rates:
        needs = {
            "issue": sum(counts.values()) / rates["issue"],
            "half-rate units": counts["half"] / rates["half"],
            "quotients": counts["special"] / rates["special"],
            "memory": counts["memory"] / rates["memory"],
        }
    else:
        needs = {
            "vector units": counts["vector"] / rates["vector"] + counts["special"] / rates["special"],
            "scalar unit": counts["scalar"] / rates["scalar"],
            "memory": counts["memory"] / rates["memory"],
        }
    limit = max(needs, key=needs.get)
    return needs[limit], limit


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
        span = step_loop(code, labels)
        least, most, once = mix(code, labels, span)
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
            "loop_least": sum(least.values()),
            "loop_most": sum(most.values()),
            "lane_end": sum(once.values()),
            "least": least,
            "most": most,
            "once": once,
            "harmful": harmful,
        })
    return rows


def check(rows):
    wrong = []
    for row in rows:
        place = f"{row['device']}, {row['kernel']}"
        part = "generator" if row["kernel"] == "generator" else "cut-out" if ".cut-out." in row["kernel"] else "other"
        if row["spilled"]:
            wrong.append(f"{place}: {row['spilled']} spilled (registers or bytes); none is allowed")
        if row["registers"] > BUDGET[part]:
            wrong.append(f"{place}: {row['registers']} registers, at most {BUDGET[part]} for {part}")
        wrong += [f"{place}: a fused operation changes results: {text}" for text in row["harmful"]]
    return wrong


def measured_rates(path):
    """Lane-steps per second by the device's clock, or the wall's where it has none: the best row of each kernel."""
    best = {}
    if path:
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                if row["backend"].startswith("device") and row["wanted"] == "Verdicts":
                    lanes = row["backend"].partition(":")[2] or "32"
                    seconds = float(row["device_seconds"] or 0) or float(row["seconds"])
                    key = (f"{row['category']}.{row['model']}".lower(), lanes)
                    best[key] = max(best.get(key, 0), int(row["lane_steps"]) / seconds)
    return best


def predict(rows, steps_path, measured_path):
    """Lane-steps per second of each chip, for each kernel and for the mean of a study, as a table of CSV rows.

    A warp makes the steps of its busiest invocation; the instructions after a lane's end occupy the whole warp. `all` and
    `none` of the branches inside a step are taken: the truth lies between.
    """
    by = {(row["device"], row["kernel"].removeprefix("paper.")): row for row in rows}
    with open(steps_path, newline="") as file:
        steps = list(csv.DictReader(file))
    measured = measured_rates(measured_path)
    print("chip,kernel,lanes_per_invocation,busy,all_branches,no_branch,bound_by,of_issue_limit,measured,measured_of_issue_limit")
    for chip, (device, units, clock, rates) in CHIPS.items():
        warp = 32 if "issue" in rates else 64
        for lanes in sorted({int(row["lanes_per_invocation"]) for row in steps}):
            spent, total = collections.Counter(), 0
            for row in steps:
                kernel = by.get((device, row["kernel"]))
                if kernel is None or int(row["warp"]) != warp or int(row["lanes_per_invocation"]) != lanes:
                    continue
                lane_steps, warp_steps = int(row["lane_steps"]), int(row["warp_steps"])
                ends, _ = clocks(kernel["once"], rates)
                total += lane_steps
                speeds = {}
                for bound in ("most", "least"):
                    per_step, limit = clocks(kernel[bound], rates)
                    needed = warp_steps * per_step + int(row["lanes"]) * warp * ends
                    spent[bound] += needed
                    speeds[bound] = units * clock * lane_steps / needed
                busy = lane_steps / warp_steps
                # What all issue slots could do if every lane were busy.
                slots = rates.get("issue", rates.get("vector"))
                peak = units * clock * slots / max(sum(kernel["most"].values()), 1)
                rate = measured.get((row["kernel"].lower(), str(lanes)))
                seen = f"{rate:.3g},{rate / peak:.2f}" if rate else ","
                print(f"{chip},{row['kernel']},{lanes},{busy:.2f},{speeds['most']:.3g},{speeds['least']:.3g},{limit},"
                      f"{speeds['most'] / peak:.2f},{seen}")
            if total:
                low, high = (units * clock * total / spent[bound] for bound in ("most", "least"))
                print(f"{chip},mean of a study,{lanes},,{low:.3g},{high:.3g},,,,")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("csv", nargs="+")
    parser.add_argument("--steps")
    parser.add_argument("--measured")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--out")
    options = parser.parse_args()
    rows = table(options.folder, statistics_of(options.csv))
    columns = list(rows[0])[:-4]
    print(" ".join(f"{c:>13}" if k > 1 else f"{c:28}" for k, c in enumerate(columns)))
    for row in rows:
        print(" ".join(f"{row[c]:13}" if k > 1 else f"{row[c]:28}" for k, c in enumerate(columns)))
    if options.out:
        with open(options.out, "w", newline="") as file:
            writer = csv.DictWriter(file, columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    if options.steps:
        predict(rows, options.steps, options.measured)
    if options.check:
        wrong = check(rows)
        for line in wrong:
            print(line, file=sys.stderr)
        sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
