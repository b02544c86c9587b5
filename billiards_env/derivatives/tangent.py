"""The derivative of a kernel, made from its source: `tangent_of` returns the kernel's tangent.

The tangent of `f(x, y) -> value` is `d_f(x, y, d_x, d_y) -> (value, d_value)`. The change `d_value` of the result
belongs to the changes `d_x` and `d_y` of the arguments (forward mode, one direction; Griewank and Walther 2008, chapter
3). A change of a tuple is a tuple, and that of a NamedTuple or of a record has the fields that the kernel reads.
Arguments named in `constant` have no change. In a call of another kernel, the changes of
arguments that are constant in this call are left out. The tangent computes the value with the operations of the kernel.

A kernel may consist of:

* assignments to names, to `a[i]` and to tuples of them, also `a = b = value` and `a += value`; `if`; `for` over
  constant values, `break` and `continue`; `return`,
* numbers, names, tuples, attributes, `a[i]` with a constant i,
* `+ - * /`, comparisons, `and`, `or`, `not`, `a if condition else b`,
* `abs`, `math.sqrt`, `max` and `min` of two numbers, NamedTuples, which may have keyword arguments, and calls of other
  kernels with positional arguments, but no call of a kernel within `a if condition else b` or a condition,
* calls of kernels that are fields of an argument without a change. The tangent of `laws.friction` is `laws.d_friction`,
  for the same constants as in the call.

A call whose result does not depend on what changes is left as it is, unless the kernel writes to an array. A kernel
without arguments that makes an array has a rule, whose change is another array.

Everything else is an error, whose message has the line. The tangents of called kernels are made in the same way. `rule`
gives a kernel a tangent of another form: for an iteration, differentiate the equation that it solves. The rule None
ignores the change of the result.

The derivative at a branch is that of the branch that is taken. So the derivative of `max(a, b)` and `min(a, b)` at
a = b is that of a, that of `abs(x)` at 0 is 1, and that of `math.sqrt(x)` at 0 is 0.
"""

from __future__ import annotations

import ast
import builtins
import copy
import functools
import inspect
import itertools
import linecache
import textwrap
from collections.abc import Callable, Collection, Iterator
from types import FunctionType
from typing import Any, NamedTuple, NoReturn

from billiards_env.jit import inlined, kernel


def as_kernel(tangent: Any) -> Any:
    """Returns a tangent as a kernel that may be an argument."""
    return inlined(lambda *arguments: tangent(*arguments))


class _Rule(NamedTuple):
    call: Callable[..., Any] | None
    constant: frozenset[str]


_RULES: dict[Any, list[_Rule]] = {}  # by kernel


class Tangent:
    """The tangent of a kernel. It is a kernel whose source is made when the first kernel that calls it is compiled.

    Attributes:
        function: The kernel.
        constant: The names of its arguments that do not change.
    """

    def __init__(self, function: Callable[..., Any], constant: frozenset[str]) -> None:
        self.function, self.constant = function, constant
        self.plain: Any = getattr(function, "py_func", function)

    @functools.cached_property
    def _writer(self) -> _Writer:
        return _Writer(self.plain, self.constant)

    @property
    def result_changes(self) -> bool:
        """Whether its result, or an array that it writes to, depends on the arguments that change."""
        return self._writer.result_changes

    @property
    def source(self) -> str:
        """Its source."""
        return self._writer.source

    @functools.cached_property
    def kernel(self) -> Any:
        """The compiled function."""
        source, file = self.source, f"<tangent of {self.plain.__module__}.{self.plain.__qualname__}>"
        linecache.cache[file] = len(source), None, source.splitlines(keepends=True), file  # for tracebacks
        names = _names(self.plain) | self._writer.tangents | {"__name__": self.plain.__module__}
        exec(compile(source, file, "exec"), names)
        options = getattr(self.function, "targetoptions", {})
        return (inlined if options.get("forceinline") else kernel)(names[f"d_{self.plain.__name__}"])

    @property
    def code_parts(self) -> tuple[Any, ...]:
        """What its machine code depends on, for `jit.code_hash`: the kernel, the maker of tangents and the rules."""
        writer = [method for method in vars(_Writer).values() if isinstance(method, FunctionType)]
        return self.plain, self.constant, _tangent.__wrapped__, writer

    @property
    def _numba_type_(self) -> Any:
        return self.kernel._numba_type_

    def __call__(self, *args: Any) -> Any:
        """Calls the kernel from Python."""
        return self.kernel(*args)


def rule(function: Callable[..., Any], *, constant: Collection[str] = ()) -> Callable[[Any], Any]:
    """Returns a decorator that makes a kernel the tangent of `function` if the arguments `constant` do not change.

    It also takes None, for a result whose change is ignored.
    """

    def decorate(call: Any) -> Any:
        _RULES.setdefault(function, []).append(_Rule(call, frozenset(constant)))
        return call

    return decorate


def tangent_of(function: Callable[..., Any], *, constant: Collection[str] = ()) -> Any:
    """Returns the tangent of a kernel, made at the first compile.

    Args:
        function: The kernel, a function of a module.
        constant: The names of the arguments that do not change.

    Raises:
        SyntaxError: At the first compile, if the kernel contains something that has no tangent here.
    """
    return _tangent(function, frozenset(constant)).call


@functools.cache
def _tangent(function: Any, constant: frozenset[str]) -> _Rule:
    """Returns the rule of a kernel that leaves out the most constants; without a rule the generated tangent."""
    rules = [rule for rule in _RULES.get(function, ()) if rule.constant <= constant]
    return max(rules, key=lambda rule: len(rule.constant), default=_Rule(Tangent(function, constant), constant))


def _names(plain: Any) -> dict[str, Any]:
    """Returns the names that a function reads from its module and from the function around it."""
    read = {name: plain.__globals__[name] for name in plain.__code__.co_names if name in plain.__globals__}
    cells = plain.__closure__ or ()
    return read | {name: cell.cell_contents for name, cell in zip(plain.__code__.co_freevars, cells, strict=True)}


def _is_plain(function: str) -> bool:
    """Returns whether a function is not a kernel."""
    return hasattr(builtins, function) or function.startswith("math.")


def _names_in(target: Any) -> set[str]:
    """Returns the names in the target of an assignment, which are values or arrays."""
    if isinstance(target, ast.Tuple):
        return set().union(*map(_names_in, target.elts))
    name = target.value if isinstance(target, ast.Subscript) else target
    return {name.id} - {"_"} if isinstance(name, ast.Name) else set()


def _pairs(target: Any, value: Any) -> Iterator[tuple[Any, Any]]:
    """Yields the parts of the target of an assignment with their values."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        for one, other in zip(target.elts, value.elts, strict=True):
            yield from _pairs(one, other)
    else:
        yield target, value


class _Writer:
    """Writes the source of a tangent."""

    def __init__(self, plain: Any, constant: frozenset[str]) -> None:
        lines, first = inspect.getsourcelines(plain)
        self.at = f"{plain.__code__.co_filename}:", first - 1
        self.globals, self.lines, self.depth, self.calls = _names(plain), [], 0, 0
        self.tangents: dict[str, Any] = {}
        (definition,) = ast.parse(textwrap.dedent("".join(lines))).body
        if not isinstance(definition, ast.FunctionDef):
            self.refuse(definition)
        for name in ast.walk(definition):
            if isinstance(name, ast.Name) and name.id.startswith("d_"):
                self.refuse(name)
        arguments = [argument.arg for argument in definition.args.args]
        self.kept, self.active = constant, set(arguments) - constant
        self.complete = False  # whether `active` is
        while (larger := self.active | self.changed(definition)) != self.active:
            self.active = larger
        self.complete = True
        changes = [f"d_{name}" for name in arguments if name not in constant]
        self.write(f"def d_{definition.name}({', '.join(arguments + changes)}):")
        self.block(definition.body)
        returned = (node.value for node in ast.walk(definition) if isinstance(node, ast.Return))
        written = (node for node in ast.walk(definition) if isinstance(node, ast.Subscript))
        writes = any(isinstance(node.ctx, ast.Store) and self.changes(node) for node in written)
        self.result_changes = writes or any(map(self.changes, returned))
        self.source = ast.unparse(ast.parse("\n".join(self.lines))) + "\n"

    def refuse(self, node: Any) -> NoReturn:
        line = self.at[1] + node.lineno
        raise SyntaxError(f"{self.at[0]}{line}: {ast.unparse(node)}: expected an expression of physics.tangent")

    def write(self, line: str) -> None:
        self.lines.append("    " * self.depth + line)

    # Which names change. ------------------------------------------------------------------------------------------

    def changed(self, definition: ast.FunctionDef) -> set[str]:
        """Returns the names that get a value that changes."""
        names: set[str] = set()
        for node in ast.walk(definition):
            if isinstance(node, ast.Assign | ast.AugAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                for part, value in itertools.chain(*(_pairs(target, node.value) for target in targets)):
                    names |= _names_in(part) if self.changes(value) else set()
        return names

    def changes(self, node: Any) -> bool:
        """Returns whether an expression changes."""
        match node:
            case ast.Name():
                return node.id in self.active
            case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
                return False
            case ast.IfExp():
                return self.changes(node.body) or self.changes(node.orelse)
            case ast.Subscript() | ast.Attribute():
                return self.changes(node.value)
            case ast.Call(func=ast.Name(id="len" | "range")):
                return False
            case ast.Call() if self.is_kernel(node) and (
                not node.args or (self.complete and any(map(self.changes, node.args)))
            ):
                tangent: Any = _tangent(*self.called(node)).call
                return tangent.result_changes if isinstance(tangent, Tangent) else tangent is not None
        return any(self.changes(part) for part in ast.iter_child_nodes(node))

    def is_kernel(self, node: ast.Call) -> bool:
        """Returns whether a call calls a kernel."""
        function = ast.unparse(node.func)
        return function in self.globals and not _is_plain(function) and not hasattr(self.globals[function], "_fields")

    def is_passed(self, function: Any) -> bool:
        """Returns whether a call calls a field of an argument that does not change."""
        return isinstance(function, ast.Attribute) and ast.unparse(function.value) in self.kept

    def called(self, node: ast.Call) -> tuple[Any, frozenset[str]]:
        """Returns the kernel that a call calls, and the names of its arguments that do not change."""
        kernel = self.globals[ast.unparse(node.func)]
        names = inspect.signature(getattr(kernel, "py_func", kernel)).parameters
        parts = zip(names, node.args, strict=True)
        return kernel, frozenset(name for name, part in parts if not self.changes(part))

    # Statements. --------------------------------------------------------------------------------------------------

    def block(self, body: list[ast.stmt]) -> None:
        self.depth += 1
        for statement in body:
            self.statement(statement)
        self.depth -= 1

    def statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Constant()):
                pass  # the docstring
            case ast.Assign():
                value, change = self.hoisted(node.value)
                if len(node.targets) > 1 and change:
                    name, self.calls = f"_{self.calls}", self.calls + 1
                    self.write(f"{name}, d_{name} = {value}, {change}")
                    value, change = name, f"d_{name}"
                for target in node.targets:
                    self.assign(target, value, change, node.value)
            case ast.AugAssign():
                operation = ast.copy_location(ast.BinOp(node.target, node.op, node.value), node)
                self.assign(node.target, *self.hoisted(operation), operation)
            case ast.If():
                self.write(f"if {self.constant(node.test)}:")
                self.block(node.body)
                if node.orelse:
                    self.write("else:")
                    self.block(node.orelse)
            case ast.For(orelse=[]) if not self.changes(node.iter) and not self.changes(node.target):
                self.write(f"for {ast.unparse(node.target)} in {self.constant(node.iter)}:")
                self.block(node.body)
            case ast.Break() | ast.Continue():
                self.write(ast.unparse(node))
            case ast.Return():
                value, change = self.hoisted(node.value)
                self.write(f"return {value}, {change or self.zero(node.value)}")
            case _:
                self.refuse(node)

    def assign(self, target: Any, value: str, change: str | None, node: Any) -> None:
        names = _names_in(target)
        places = (part for part, _ in _pairs(target, target))
        if not all(isinstance(part, ast.Name | ast.Subscript) for part in places) or self.kept.intersection(names):
            self.refuse(target)
        if not names & self.active:
            self.write(f"{ast.unparse(target)} = {value}")
        else:
            zero = self.zero(target if isinstance(target, ast.Tuple) else node)
            self.write(f"({ast.unparse(target)}), ({self.changed_part(target)}) = {value}, {change or zero}")

    def changed_part(self, target: Any) -> str:
        """Returns the target of an assignment for changes."""
        if not _names_in(target) & self.active:
            return "_"
        if isinstance(target, ast.Tuple):
            return f"({', '.join(map(self.changed_part, target.elts))})"
        return f"d_{ast.unparse(target)}"

    # Expressions. -------------------------------------------------------------------------------------------------

    def zero(self, node: Any) -> str:
        """Returns the change of an expression that does not change."""
        if isinstance(node, ast.Tuple):
            return f"({', '.join(map(self.zero, node.elts))},)"
        return "0.0"

    def constant(self, node: Any) -> str:
        """Returns the source of an expression in which no kernel is called."""
        for part in ast.walk(node):
            if isinstance(part, ast.Call) and not _is_plain(ast.unparse(part.func)):
                self.refuse(part)
        return ast.unparse(node)

    def hoisted(self, node: Any) -> tuple[str, str | None]:
        """Returns the value and the change of an expression, after statements with the kernels that it calls.

        The change is None if it is zero.
        """
        tree = _Calls(self).visit(copy.deepcopy(node))
        return ast.unparse(tree), self.change(tree)

    def change(self, node: Any) -> str | None:
        """Returns the source of the change of an expression without calls of kernels; None if it is zero."""
        if not self.changes(node):
            return None
        match node:
            case ast.Name():
                return f"d_{node.id}"
            case ast.Attribute():
                return f"{self.change(node.value)}.{node.attr}"
            case ast.Subscript():
                return f"{self.change(node.value)}[{ast.unparse(node.slice)}]"
            case ast.Tuple():
                return f"({', '.join(self.change(part) or self.zero(part) for part in node.elts)},)"
            case ast.UnaryOp(op=ast.USub()):
                return f"(-{self.change(node.operand)})"
            case ast.IfExp():
                one, two = (self.change(part) or self.zero(part) for part in (node.body, node.orelse))
                return f"({one} if {ast.unparse(node.test)} else {two})"
            case ast.BinOp():
                return self.binary(node, self.change(node.left), self.change(node.right))
            case ast.Call():
                return self.call(node)
        self.refuse(node)

    def binary(self, node: ast.BinOp, da: str | None, db: str | None) -> str:
        a, b = f"({ast.unparse(node.left)})", f"({ast.unparse(node.right)})"
        match node.op:
            case ast.Add():
                return f"({da} + {db})" if da and db else str(da or db)
            case ast.Sub():
                return f"({da} - {db})" if da and db else da or f"(-{db})"
            case ast.Mult():
                return "(" + " + ".join([f"{da} * {b}"] * bool(da) + [f"{a} * {db}"] * bool(db)) + ")"
            case ast.Div():
                top = f"({da or 0.0} - {a} / {b} * {db})" if db else da
                return f"({top} * (1.0 / {b}))"  # the compiler computes the factor once for all directions
        self.refuse(node)

    def call(self, node: ast.Call) -> str:
        function, parts = ast.unparse(node.func), [self.change(part) or "0.0" for part in node.args]
        values = [f"({ast.unparse(part)})" for part in node.args]
        match function, values, parts:
            case "math.sqrt", [v], [dv]:
                return f"({dv} * (0.5 / math.sqrt({v})) if {v} > 0.0 else 0.0)"
            case "abs", [v], [dv]:
                return f"({dv} if {v} >= 0.0 else -{dv})"
            case "max" | "min", [a, b], [da, db]:
                return f"({da} if {a} {'>=' if function == 'max' else '<='} {b} else {db})"
        if not hasattr(self.globals.get(function), "_fields"):
            self.refuse(node)
        parts += [f"{keyword.arg}={self.change(keyword.value) or '0.0'}" for keyword in node.keywords]
        return f"{function}({', '.join(parts)})"


class _Calls(ast.NodeTransformer):
    """Replaces calls of kernels by names, after statements that call their tangents."""

    def __init__(self, writer: _Writer) -> None:
        self.writer = writer

    def visit_IfExp(self, node: ast.IfExp) -> ast.IfExp:
        self.writer.constant(node)
        return node

    def visit_Call(self, node: ast.Call) -> Any:
        writer, function = self.writer, ast.unparse(node.func)
        called = writer.globals.get(function)
        if node.keywords and not hasattr(called, "_fields"):
            writer.refuse(node)
        self.generic_visit(node)
        if _is_plain(function) or hasattr(called, "_fields"):
            return node
        if called is None and not writer.is_passed(node.func):
            writer.refuse(node)
        result, values = f"_{writer.calls}", ", ".join(map(ast.unparse, node.args))
        writer.calls += 1
        if not writer.changes(node):
            writer.write(f"{result} = {function}({values})")
        else:
            d_function, changes = self.passed(node) if called is None else self.known(node)
            writer.write(f"{result}, d_{result} = {d_function}({', '.join([values, *changes])})")
            writer.active.add(result)
        return ast.copy_location(ast.Name(result), node)

    def passed(self, node: ast.Call) -> tuple[str, list[str]]:
        """Returns the name of the tangent of a field of an argument, and the changes of its arguments."""
        argument, _, field = ast.unparse(node.func).rpartition(".")
        return f"{argument}.d_{field}", [change for change in map(self.writer.change, node.args) if change]

    def known(self, node: ast.Call) -> tuple[str, list[str]]:
        """Returns the name of the tangent of another kernel, and the changes of its arguments."""
        writer, (called, constant) = self.writer, self.writer.called(node)
        tangent, d_function = _tangent(called, constant), f"d_{ast.unparse(node.func)}"
        while writer.tangents.setdefault(d_function, tangent.call) is not tangent.call:
            d_function += "_"
        names = inspect.signature(getattr(called, "py_func", called)).parameters
        changing = [part for name, part in zip(names, node.args, strict=True) if name not in tangent.constant]
        return d_function, [writer.change(part) or writer.zero(part) for part in changing]
