"""A comment at a kernel's signature lists the arguments that it changes: `def move(state, i, t):  # out: state`."""

import ast
import re
from pathlib import Path

import pytest

from billiards_env.engine.space import Space

ROOT = Path(__file__).resolve().parents[2] / "billiards_env"
DECORATORS = {"kernel", "inlined", "entry_point", "allocating"}
FILES = sorted(path for package in ("derivatives", "engine", "physics") for path in (ROOT / package).rglob("*.py"))
MOST = 8  # arguments


def kernels_of(path):
    """Yields each kernel of a module, with the names that its signature lists as changed."""
    lines = path.read_text(encoding="utf-8").splitlines()
    for node in ast.walk(ast.parse("\n".join(lines))):
        if isinstance(node, ast.FunctionDef) and {ast.unparse(d) for d in node.decorator_list} & DECORATORS:
            match = re.search(r":  # out: (.+)", "\n".join(lines[node.lineno - 1 : node.body[0].lineno - 1]))
            yield node, match[1].split(", ") if match else []


KERNELS = {
    path: {node.name: ([part.arg for part in node.args.args], out) for node, out in kernels_of(path)} for path in FILES
}


BY_NAME = {name: kernel for kernels in KERNELS.values() for name, kernel in kernels.items()}
SPACES = [ROOT / "engine" / f"{name}.py" for name in ("on_cloth", "pit_on_cloth", "in_space", "pit_in_space")]
BY_MODULE = {f"{path.stem}.{name}": kernel for path in FILES for name, kernel in KERNELS[path].items()}


def in_any_space():
    """Returns the kernels of `Space` by the name `scene.space.*`, which change what any of their versions changes."""
    known = {}
    for name in Space._fields:
        versions = [KERNELS[path][name] for path in SPACES if name in KERNELS[path]] or [BY_NAME[name]]
        known[f"scene.space.{name}"] = versions[0][0], list({part for _, out in versions for part in out})
    return known


def known_in(path):
    """Returns the kernels that a module calls, by name: its own kernels and the kernels that it imports."""
    known = BY_NAME | BY_MODULE | in_any_space() | {"work.record": BY_NAME["record_times_over"]}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("billiards_env."):
            source = KERNELS.get(ROOT.parent / f"{node.module.replace('.', '/')}.py", {})
            known |= {alias.name: source[alias.name] for alias in node.names if alias.name in source}
        if isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("for_all_shots("):
            known[ast.unparse(node.targets[0])] = known["run_all"]
    return known | KERNELS[path]


class Writes(ast.NodeVisitor):
    """The arguments that a kernel changes: `sure`, and `perhaps` for arguments that it puts into one tuple."""

    def __init__(self, node, known):
        self.known, self.sure, self.perhaps = known, set(), set()
        self.roots = {argument.arg: {argument.arg} for argument in node.args.args}  # by name: what it is a part of
        for statement in node.body:
            self.visit(statement)

    def roots_of(self, node):
        match node:
            case ast.Name():
                return self.roots.get(node.id, set())
            case ast.Attribute() | ast.Subscript() | ast.Starred() | ast.keyword():
                return self.roots_of(node.value)
            case ast.Tuple():
                return set().union(*map(self.roots_of, node.elts))
            case ast.Call(func=ast.Name(id=name)) if name[0].isupper():  # a NamedTuple; kernels return no arrays
                return set().union(*(self.roots_of(part) or {"here"} for part in [*node.args, *node.keywords]))
        return set()

    def bind(self, target, value):
        if isinstance(target, ast.Tuple):
            same = isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts)
            for part, of in zip(target.elts, value.elts if same else [value] * len(target.elts), strict=True):
                self.bind(part, of)
        elif isinstance(target, ast.Name):
            self.roots[target.id] = self.roots_of(value)
        else:
            self.change(target)

    def change(self, node):
        roots = self.roots_of(node)
        (self.perhaps if len(roots) > 1 else self.sure).update(roots - {"here"})

    def visit_Assign(self, node):
        self.visit(node.value)
        for target in node.targets:
            self.bind(target, node.value)

    def visit_AugAssign(self, node):
        self.visit(node.value)
        if not isinstance(node.target, ast.Name):
            self.change(node.target)

    def visit_For(self, node):
        self.bind(node.target, node.iter)
        self.generic_visit(node)

    def visit_Call(self, node):
        names, out = self.known.get(ast.unparse(node.func), ([], []))
        for name, part in zip(names, node.args, strict=False):
            if name in out:
                self.change(part)
        self.generic_visit(node)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_signature_names_what_the_kernel_changes(path):
    known = known_in(path)
    for node, out in kernels_of(path):
        writes, at = Writes(node, known), f"{path.name}:{node.lineno}: {node.name}"
        assert writes.sure <= set(out) <= writes.sure | writes.perhaps, f"{at} changes {sorted(writes.sure)}"
        assert len(node.args.args) <= MOST, at
