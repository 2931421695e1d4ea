"""Random xacro and MJCF programs that grow: each must be read or refused within the budget of loading.

Each is loaded by a process of its own, whose CPU time and memory are measured. It must end with a robot or an
InputError, after at most the budget and what Python itself takes.

python -m tests.campaigns.growth --cases 1000 --seed 1
"""

import argparse
import functools
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

SECONDS, MEMORY = 2, 300  # the budget
PYTHON_MEMORY = 400.0  # MB that Python, NumPy and Pinocchio take besides
LOAD = """
import sys, bellcrank as bc
try:
    bc.load_robot(sys.argv[1])
    print("read")
except bc.InputError as error:
    print("refused", str(error).replace(sys.argv[1], ""))
with open("/proc/self/status") as status:  # wait4 counts what this process was copied from
    print(*(line.split()[1] for line in status if line.startswith("VmHWM")))
"""
LINK = '<link name="base"/>'
TEXTS = (
    "'x'.rjust({n})", "'x'.center({n})", "'7'.zfill({n})", "'x'.ljust({n}).replace('x', 'y'.ljust({n}))",
    "','.join(['x'.ljust({n})])", "'\\t'.expandtabs({n})", "'x' * {n}", "'%{n}d' % 3", "'a'.join(list('b'.ljust({n})))",
    "len('x'.ljust({n}) + 'y'.ljust({n}))", "2 ** 64 ** {d}", "[1] * {n}", "sum([{d}] + [{d}])",
    "str({d}).upper().ljust({n})",
)  # fmt: skip


def xacro_program(rng):
    """A xacro program: macros of macros, properties made of properties, blocks of blocks, long texts."""
    parts, levels, times = [], int(rng.integers(2, 40)), int(rng.integers(2, 12))
    kind = rng.choice(["macros", "blocks", "texts", "lists", "numbers", "conditions", "expression"])
    call = {
        "macros": '<xacro:m{k}/>', "conditions": '<xacro:if value="${{1 == 1}}"><xacro:m{k}/></xacro:if>',
        "blocks": '<xacro:m{k}><xacro:insert_block name="b"/></xacro:m{k}>',
    }  # fmt: skip
    if kind in call:
        given = ' params="*b"' if kind == "blocks" else ""
        leaf = {"macros": "<a/>", "conditions": "", "blocks": '<xacro:insert_block name="b"/>'}[kind]
        for k in range(levels):
            body = call[kind].format(k=k - 1) * times if k else leaf
            parts.append(f'<xacro:macro name="m{k}"{given}>{body}</xacro:macro>')
        last = levels - 1
        parts.append(f"<xacro:m{last}><c/></xacro:m{last}>" if kind == "blocks" else f"<xacro:m{last}/>")
    elif kind == "expression":
        text = str(rng.choice(TEXTS)).format(n=int(10 ** rng.uniform(1, 11)), d=int(rng.integers(1, 99)))
        parts.append(f'<link name="${{{text}}}"/>')
    else:
        first = {"texts": "abc", "lists": "${[1, 2]}", "numbers": "7"}[kind]
        join = {"texts": "${{{a}}}", "lists": "{a}", "numbers": "{a}"}[kind]
        glue = {"texts": "", "lists": " + ", "numbers": " * "}[kind]
        for k in range(levels):
            value = glue.join([join.format(a=f"p{k - 1}")] * times)
            value = value if kind == "texts" or not k else f"${{{value}}}"
            parts.append(f'<xacro:property name="p{k}" value="{value if k else first}"/>')
        parts.append(f'<link name="l${{p{levels - 1}}}"/>')
    return f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{"".join(parts)}{LINK}</robot>'


def mjcf_program(rng):
    """An MJCF file of nested copies, classes, frames or bodies."""
    levels, count = int(rng.integers(1, 9)), int(10 ** rng.uniform(0.3, 6))
    body = '<body><joint/><geom size="0.1"/></body>'
    kind = rng.choice(["replicate", "frame", "body", "default", "text"])
    default = ""
    if kind == "replicate":
        for _ in range(levels):
            body = f'<replicate count="{count}" offset="1 0 0" euler="0 0 {rng.uniform(0, 9):.2f}">{body}</replicate>'
            count = int(10 ** rng.uniform(0.3, 3))
    elif kind == "text":
        body = body.replace("0.1", "0.1 " * min(count, 10**6))
    elif kind == "default":
        depth = min(count, 5000)
        default = "".join(f'<default class="c{k}">' for k in range(depth)) + "</default>" * depth
    else:
        depth = min(count, 5000)
        body = f"<{kind}>" * depth + body + f"</{kind}>" * depth
    return f"<mujoco><default>{default}</default><worldbody>{body}</worldbody></mujoco>"


def load(path):
    """(what was printed, CPU time in s, memory in MB) of a process that loads a robot file, with the processes of it.

    The memory is its own: that of a process for xacro is limited by the system.
    """
    budget = {"BELLCRANK_LOADING_SECONDS": str(SECONDS), "BELLCRANK_LOADING_MEMORY": str(MEMORY)}
    process = subprocess.Popen(
        [sys.executable, "-c", LOAD, str(path)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env=os.environ | budget,
    )  # fmt: skip
    said = process.stdout.read()
    process.stdout.close()
    _, _, used = os.wait4(process.pid, 0)
    process.returncode = 0
    said, _, kilobytes = said.rstrip().rpartition("\n")
    return said, used.ru_utime + used.ru_stime, float(kilobytes) / 1e3 if kilobytes.isdigit() else np.inf


@functools.cache
def python_seconds():
    """CPU time in s that Python, NumPy and Pinocchio take besides on this machine: twice that of a one-link robot."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one_link.xacro"
        path.write_text(f'<robot name="r">{LINK}</robot>')
        return 2.0 * max(load(path)[1] for _ in range(2))


def fault(folder, seed):
    """(what is wrong with the program of this seed or "", whether it was read)."""
    rng = np.random.default_rng(seed)
    xacro = rng.random() < 0.6
    path = Path(folder) / f"p{seed}{'.xacro' if xacro else '.xml'}"
    path.write_text(xacro_program(rng) if xacro else mjcf_program(rng))
    said, seconds, memory = load(path)
    if not said.startswith(("read", "refused")) or "Traceback" in said:
        return f"{path.name}: {said[-300:]}", False
    if seconds > SECONDS + python_seconds() or memory > MEMORY + PYTHON_MEMORY:
        return f"{path.name}: {seconds:.1f} s, {memory:.0f} MB: {said[:100]}", False
    return "", said.startswith("read")


def main():
    """Run the campaign and print what is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    wrong = read = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.cases):
            said, was_read = fault(folder, given.seed * 100_000 + number)
            read, wrong = read + was_read, wrong + bool(said)
            if said:
                print(said, flush=True)
    print(f"{given.cases} programs, {read} read, {given.cases - read - wrong} refused; {wrong} wrong")


if __name__ == "__main__":
    main()
