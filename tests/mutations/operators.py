"""What is changed in the code: operators of cosmic-ray that make sense here, and some of our own.

cosmic-ray replaces each operator by each other, mostly by what fails at once with a TypeError;
such mutants are killed by any test and flatter the result. `KINDS` names those of its operators
whose mutants still run. Ours add what its do not have: numbers by a factor, words of a verdict,
values returned, arguments and branches swapped, conditions dropped.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from cosmic_ray.operators.operator import Example, Operator
from cosmic_ray.operators.provider import OperatorProvider
from parso.python.tree import Name

__all__ = ["KINDS"]

# Words that carry a verdict, each with one that would be believed as well.
_WORDS = {
    "note": "warning",
    "warning": "note",
    "refusal": "warning",
    "rising": "falling",
    "falling": "rising",
    "flat": "rising",
    "mixed": "rising",
    "excellent": "good",
    "good": "poor",
    "poor": "good",
    "fitted": "shared",
    "shared": "fitted",
    "fixed": "fitted",
    "at_bound": "fitted",
    "not_identifiable": "fitted",
    "held_out": "fitted",
    "converged": "no_descent",
    "rebound": "bump",
    "bump": "rebound",
    "force": "displacement",
    "displacement": "force",
    "velocity": "displacement",
    "low": "high",
    "high": "low",
    "late": "early",
    "early": "late",
    "more": "less",
    "less": "more",
    "above": "below",
    "below": "above",
    "upper": "lower",
    "lower": "upper",
    "flat downward": "flat upward",
    "flat upward": "flat downward",
    "zero_phase": "causal",
    "causal": "zero_phase",
    "none": "zero_phase",
    "joint": "paper",
    "paper": "joint",
    "plain": "paper",
    "linear": "log",
    "log": "linear",
    "reciprocal": "log",
    "from_first": "from_last",
    "from_last": "from_first",
    "r_m1": "r_m2",
    "r_m2": "r_m1",
    "r_m3": "k_e",
    "k_e": "r_m3",
    "f_f": "f_0",
    "f_0": "f_f",
    "m": "mm",
    "mm": "m",
    "N": "kN",
    "Pa": "bar",
    "bar": "Pa",
    "%": "",
    "ms": "s",
    "yes": "no",
    "passed": "failed",
    "failed": "passed",
    "not evaluated": "passed",
}
_TWINS = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "any": "all",
    "all": "any",
    "low": "high",
    "high": "low",
    "first": "last",
    "last": "first",
    "start": "stop",
    "stop": "start",
    "displacement": "velocity",
    "velocity": "displacement",
    "is_minimum": "is_maximum",
}
# Functions whose arguments may change places.
_SYMMETRIC = {"max", "min", "maximum", "minimum", "hypot", "isclose", "gcd", "join"}


class _Text(Operator):
    """An operator that puts other text in place of one node."""

    def options(self, node) -> list[str]:
        raise NotImplementedError

    def mutation_positions(self, node):
        for _ in self.options(node):
            yield node.start_pos, node.end_pos

    def mutate(self, node, index):
        prefix = node.get_first_leaf().prefix
        return Name(self.options(node)[index], node.start_pos, prefix=prefix)

    @classmethod
    def examples(cls):
        return ()


def code(node) -> str:
    """Return a node's text without the blanks before it."""
    return node.get_code(include_prefix=False)


class Numbers(_Text):
    """A count by one, a quantity by two and by ten."""

    def options(self, node):
        if node.type != "number":
            return []
        text = node.value
        if text.lower().endswith("j"):
            return []
        value = eval(text)  # noqa: S307 - a literal of our own source
        if isinstance(value, int):
            return [str(value + 1), str(value - 1)] if value != 0 else ["1"]
        if value == 0.0:
            return ["1.0"]
        return [repr(float(f"{value * factor:.12g}")) for factor in (2.0, 0.5, 10.0, 0.1)]

    @classmethod
    def examples(cls):
        return (Example("x = 3", "x = 4"), Example("x = 0.5", "x = 0.25", occurrence=1))


class Words(_Text):
    """A word that carries a verdict, or a name, by another that would be believed as well."""

    def options(self, node):
        if node.type != "string" or not node.value.startswith(('"', "'")):
            return []
        word = node.value[1:-1]
        return [f'"{_WORDS[word]}"'] if word in _WORDS else []

    @classmethod
    def examples(cls):
        return (Example('x = "note"', 'x = "warning"'),)


class Twins(_Text):
    """A function or an attribute by the one that does the opposite."""

    def options(self, node):
        if node.type != "name" or node.value not in _TWINS:
            return []
        before = node.get_previous_leaf()
        is_attribute = before is not None and before.value == "."
        after = node.get_next_leaf()
        is_call = node.value in {"min", "max", "any", "all"} and after.value == "("
        return [_TWINS[node.value]] if is_attribute or is_call else []

    @classmethod
    def examples(cls):
        return (Example("x = max(a)", "x = min(a)"),)


class Returned(_Text):
    """What a function returns, by the type that it says it returns."""

    def options(self, node):  # noqa: PLR0911 - one for each type
        if node.parent is None or node.parent.type != "return_stmt" or node.type == "keyword":
            return []
        function = node.parent
        while function is not None and function.type not in {"funcdef", "lambdef"}:
            function = function.parent
        told = function.annotation if function is not None else None
        says = "" if told is None else code(told)
        text = code(node)
        if says in {"float", "FloatArray"} or says.startswith("NDArray[np.float"):
            return [f"2.0 * ({text})"]
        if says == "int":
            return [f"1 + ({text})"]
        if says == "bool":
            return ["True", "False"]
        if says == "str":
            return ['""'] if text not in {'""', "''"} else []
        if says.startswith("tuple[") and says.endswith("...]") and text != "()":
            return ["()"]
        if says.endswith("| None"):
            return ["None"]
        return []

    @classmethod
    def examples(cls):
        return (Example("def f() -> bool:\n    return x", "def f() -> bool:\n    return True"),)


class SwappedArguments(_Text):
    """The first two arguments of a call change places."""

    def options(self, node):
        if node.type != "arglist" or node.parent.type != "trailer":
            return []
        name = node.get_previous_leaf().get_previous_leaf()
        if name is not None and name.value in _SYMMETRIC:
            return []
        parts = [child for child in node.children if child != ","]
        if any(part.type == "argument" for part in parts[:2]) or len(parts) < 2:
            return []
        texts = [code(part) for part in parts]
        if texts[0] == texts[1]:
            return []
        return [", ".join([texts[1], texts[0], *texts[2:]])]

    @classmethod
    def examples(cls):
        return (Example("f(a, b)", "f(b, a)"),)


class SwappedBranches(_Text):
    """`a if c else b` with a and b changed."""

    def options(self, node):
        if node.type != "test" or len(node.children) != 5 or node.children[1] != "if":
            return []
        one, condition, other = (code(node.children[k]) for k in (0, 2, 4))
        return [f"{other} if {condition} else {one}"] if one != other else []

    @classmethod
    def examples(cls):
        return (Example("x = a if c else b", "x = b if c else a"),)


class DroppedConditions(_Text):
    """A condition that always holds, or never; one half of an `and` or `or` left out."""

    def options(self, node):
        parent = node.parent
        if node.type in {"and_test", "or_test"}:
            parts = node.children
            word = f" {parts[1].value} "
            halves = [code(part) for part in parts[::2]]
            return [word.join(halves[:k] + halves[k + 1 :]) for k in range(len(halves))]
        if parent is None:
            return []
        place = parent.children.index(node)
        before = parent.children[place - 1] if place else None
        if parent.type == "if_stmt" and before is not None and before in ("if", "elif"):
            return ["True", "False"]
        if parent.type in {"comp_if", "sync_comp_for"} and before == "if":
            return ["True"]
        return []

    @classmethod
    def examples(cls):
        return (Example("if a:\n    x()", "if True:\n    x()"),)


class Membership(Operator):
    """`in` by `not in` and back."""

    def mutation_positions(self, node):
        if node.type == "comparison":
            for k in range(1, len(node.children), 2):
                if code(node.children[k]) in {"in", "not in"}:
                    yield node.children[k].start_pos, node.children[k].end_pos

    def mutate(self, node, index):
        places = [
            k for k in range(1, len(node.children), 2) if code(node.children[k]) in {"in", "not in"}
        ]
        old = node.children[places[index]]
        new = "not in" if code(old) == "in" else "in"
        node.children[places[index]] = Name(new, old.start_pos, prefix=" ")
        return node

    @classmethod
    def examples(cls):
        return (Example("x = a in b", "x = a not in b"),)


def _from_library(*names: str) -> Iterator[Operator]:
    provider = OperatorProvider()
    for name in names:
        yield provider[name]()


def _pairs(stem: str, *pairs: str) -> list[str]:
    return [f"{stem}_{pair}" for pair in pairs]


_COMPARISONS = _pairs(
    "ReplaceComparisonOperator",
    *("Lt_GtE", "LtE_Gt", "Gt_LtE", "GtE_Lt", "Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is"),
)
BOUNDARIES = _pairs("ReplaceComparisonOperator", "Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt")
_ARITHMETIC = _pairs(
    "ReplaceBinaryOperator",
    *("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Mul", "Mod_Mul", "Pow_Mul"),
)

# By kind; a mutant's kind is told in the table, and a draw takes from each kind alike.
KINDS: dict[str, tuple[Operator, ...]] = {
    "number": (Numbers(),),
    "comparison": (*_from_library(*_COMPARISONS), Membership()),
    "boundary": tuple(_from_library(*BOUNDARIES)),
    "arithmetic": tuple(
        _from_library(
            *_ARITHMETIC,
            "ReplaceUnaryOperator_USub_UAdd",
            "ReplaceBinaryOperator_BitOr_BitAnd",
            "ReplaceBinaryOperator_BitAnd_BitOr",
        )
    ),
    "boolean": tuple(
        _from_library(
            "ReplaceTrueWithFalse",
            "ReplaceFalseWithTrue",
            "ReplaceAndWithOr",
            "ReplaceOrWithAnd",
            "ReplaceUnaryOperator_Delete_Not",
        )
    ),
    "condition": (DroppedConditions(),),
    "loop": tuple(_from_library("ReplaceBreakWithContinue", "ReplaceContinueWithBreak")),
    "returned": (Returned(),),
    "swapped": (SwappedArguments(), SwappedBranches()),
    "twin": (Twins(),),
    "word": (Words(),),
}
if len(set(itertools.chain(*KINDS.values()))) != sum(map(len, KINDS.values())):
    raise AssertionError("an operator stands under two kinds")
