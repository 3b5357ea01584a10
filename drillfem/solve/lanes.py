"""Kernels of the form compiler, rewritten to do several elements at once.

FFCx writes kernels as plain C: hundreds of assignments of one operation each, on numbers of one element. The same
assignments on vectors of numbers, one lane per element, are what SIMD units are made for. The rewriting knows the few
shapes of lines that FFCx writes; where it meets another, there are no lanes, and the kernels are called one by one.
"""

from __future__ import annotations

import re

#: What stands before the kernels. LANES must be that of native.c.
_HEAD = """
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif

typedef double vec __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));

/* a number, or one per lane, as one per lane; x - 0 is x, and costs nothing */
#define VEC(x) ((x) - (vec){0})

static inline vec pick(mask m, vec a, vec b) { return (vec)(((mask)a & m) | ((mask)b & ~m)); }

#define EACH(name)                          \\
    static inline vec vec_##name(vec x)     \\
    {                                       \\
        vec y;                              \\
        for (int i = 0; i < LANES; i++)     \\
            y[i] = name(x[i]);              \\
        return y;                           \\
    }
EACH(sqrt)
EACH(sin)
EACH(cos)
EACH(tan)
EACH(atan)
EACH(exp)
EACH(log)
EACH(tanh)
EACH(fabs)

static inline vec vec_pow(vec x, double n)
{
    if (n == 2)
        return x * x;
    vec y;
    for (int i = 0; i < LANES; i++)
        y[i] = pow(x[i], n);
    return y;
}

#define sqrt(x) vec_sqrt(VEC(x))
#define sin(x) vec_sin(VEC(x))
#define cos(x) vec_cos(VEC(x))
#define tan(x) vec_tan(VEC(x))
#define atan(x) vec_atan(VEC(x))
#define exp(x) vec_exp(VEC(x))
#define log(x) vec_log(VEC(x))
#define tanh(x) vec_tanh(VEC(x))
#define fabs(x) vec_fabs(VEC(x))
#define fmax(x, y) pick(VEC(x) > VEC(y), VEC(x), VEC(y))
#define fmin(x, y) pick(VEC(x) < VEC(y), VEC(x), VEC(y))
#define pow(x, n) vec_pow(VEC(x), n)
"""

#: What stands after them: their addresses, for :mod:`drillfem.solve.native`.
_TAIL = """
uintptr_t kernel_address(int number)
{{
    static void *const all[] = {{{names}}};
    return (uintptr_t)all[number];
}}
"""

DECLARATIONS = "uintptr_t kernel_address(int number);"

#: Functions that have lanes, above.
_KNOWN = {"sqrt", "sin", "cos", "tan", "atan", "exp", "log", "tanh", "fabs", "fmax", "fmin", "pow"}
_INDENT, _TARGET = r"(\s*)", r"(\w+(?:\[[^=]*\])?)"
#: Lines that are rewritten (a condition, a choice, an array, a number, an assignment), and lines that stay.
_RULES = [
    (
        re.compile(rf"{_INDENT}bool (\w+) = ([^<>=!&|?]+) ([<>]=?|[=!]=) ([^<>=!&|?]+);"),
        r"\1mask \2 = VEC(\3) \4 VEC(\5);",
    ),
    (re.compile(rf"{_INDENT}double (\w+) = (\w+) \? ([^?:]+) : ([^?:]+);"), r"\1vec \2 = pick(\3, VEC(\4), VEC(\5));"),
    (re.compile(rf"{_INDENT}double (\w+\[\d+\]) = \{{0\}};"), r"\1vec \2 = {0};"),
    (re.compile(rf"{_INDENT}double (\w+) = ([^<>=!&|?:]+);"), r"\1vec \2 = VEC(\3);"),
    (re.compile(rf"{_INDENT}{_TARGET} = ([^<>=!&|?:]+);"), r"\1\2 = VEC(\3);"),
]
_STAY = re.compile(rf"\s*(?:{_TARGET} \+= [^<>=!&|?:]+;|for \(int \w+ = \d+; \w+ < \d+; \+\+\w+\)|[{{}}]|//.*)?")
_ARGUMENTS = re.compile(
    r"\(\s*double\* restrict A,\s*const double\* restrict w,\s*const double\* restrict c,"
    r"\s*const double\* restrict coordinate_dofs,\s*(const int\* restrict entity_local_index,"
    r"\s*const uint8_t\* restrict quadrature_permutation(?:,\s*void\* custom_data)?\s*\))\s*"
)


def _closing(code: str, opening: int) -> int:
    """Position behind the brace that closes the one at ``opening``."""
    depth = 0
    for match in re.compile(r"[{}]").finditer(code, opening):
        depth += 1 if match[0] == "{" else -1
        if depth == 0:
            return match.end()
    raise ValueError("unbalanced braces")


def _kernel(name: str, code: str) -> str:
    """One kernel, from behind its name to its closing brace, with lanes. Raises ValueError at an unknown line."""
    head = _ARGUMENTS.match(code)
    if head is None:
        raise ValueError("unknown arguments")
    lines, table = [], False
    for line in code[head.end() :].splitlines():
        if table or line.lstrip().startswith("static const double "):  # tables are the same in all lanes
            table = ";" not in line
            lines.append(line)
            continue
        if not set(re.findall(r"\b(\w+)\(", line)) <= _KNOWN | {"for"}:
            raise ValueError(f"unknown function: {line}")
        for pattern, made in _RULES:
            if match := pattern.fullmatch(line):
                lines.append(match.expand(made))
                break
        else:
            if not _STAY.fullmatch(line):
                raise ValueError(f"unknown line: {line}")
            lines.append(line)
    arguments = "vec *restrict A, const vec *restrict w, const double *restrict c, const vec *restrict coordinate_dofs"
    return f"static void {name}({arguments}, {head[1]}\n" + "\n".join(lines)


def kernel_names(code: str) -> list[str]:
    """Names of the kernels of the one form of an FFCx module, in the order of its integrals."""
    (found,) = re.findall(r"^static ufcx_integral\* form_integrals_\w+\[\d+\] = \{(.*)\};", code, re.MULTILINE)
    return [f"tabulate_tensor_{name.strip().removeprefix('&')}" for name in found.split(",")]


def with_lanes(code: str, names: list[str]) -> str:
    """C source of some kernels of an FFCx module, with lanes. Raises ValueError where that is not known to be right."""
    made = []
    for name in names:
        match = re.search(rf"^void {name}(?=\()", code, re.MULTILINE)
        if match is None:
            raise ValueError(f"no kernel {name}")
        opening = code.index("{", match.end())
        made.append(_kernel(name, code[match.end() : _closing(code, opening)]))
    return "\n".join([_HEAD, *made, _TAIL.format(names=", ".join(names))])
