"""What numba's compiler does for any program and these kernels do not need, left out.

Half of what it takes to compile them is numba's own Python code. Here it skips the passes for
closures, inlining and parallel loops, resolves each operator once for the same types, and makes
machine code of what Python calls alone: what only compiled code calls is optimised where it is
compiled into its callers. The rules of `compiled.py` stand, and the results are the same.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

# by name, as the types that numba gives to itself are incomplete
_compiler: Any = import_module("numba.core.compiler")
_machinery: Any = import_module("numba.core.compiler_machinery")
_lowering: Any = import_module("numba.core.typed_passes").NativeLowering
_library: Any = import_module("numba.core.codegen").JITCodeLibrary
_stack: Any = import_module("numba.core.targetconfig").ConfigStack
_function: Any = import_module("numba.core.types.functions").BaseFunction

NEEDLESS = {
    "with_lifting",
    "inline_closure_likes",
    "rewrite_dynamic_raises",
    "make_function_op_code_to_jit_function",
    "inline_inlinables",
    "find_literally",
    "literal_unroll",
    "LiteralPropagation",
    "inline_overloads",
    "annotate_types",
    "dump_parfor_diagnostics",
}
"""Passes for closures, `with`, functions inlined as source, literals and reports."""

ALLOCATIONS = 50_000
"""Between two searches for garbage, of which compiling leaves little."""


class KernelCompiler(_compiler.CompilerBase):  # type: ignore[misc]
    """For what Python calls."""

    before_lowering: tuple[Any, ...] = ()

    def define_pipelines(self) -> list[Any]:
        """The passes of numba but for the needless ones."""
        whole = _compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        quick = _machinery.PassManager("quick")
        self.state.type_annotation = ""
        for made, text in whole.passes:
            if made is _lowering:
                for extra in self.before_lowering:
                    quick.add_pass(extra, "")
            if made._name not in NEEDLESS:
                quick.add_pass(made, text)
        quick.finalize()
        return [quick]

    def _compile_core(self) -> Any:
        with _typing_remembered(), _garbage_kept():
            return super()._compile_core()


class PartLibrary(_library):  # type: ignore[misc]
    """Code to be linked into its callers, and never into the process."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """There is none."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        """Where the variables of its code are: nowhere yet."""
        return _Nowhere()


class _Nowhere:
    def set_env(self, name: str, environment: object) -> None:
        pass


@_machinery.register_pass(mutates_CFG=False, analysis_only=True)
class _ChoosePartLibrary(_machinery.AnalysisPass):  # type: ignore[misc]
    _name = "choose_part_library"

    def __init__(self) -> None:
        _machinery.AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        name = state.func_id.func_qualname
        state.library = PartLibrary(state.targetctx.codegen(), name)
        state.library.enable_object_caching()
        return False


class PartCompiler(KernelCompiler):
    """For what only compiled code calls."""

    before_lowering = (_ChoosePartLibrary,)


_resolved: dict[Any, tuple[Any, Any]] = {}


@contextmanager
def _typing_remembered() -> Iterator[None]:
    """An operator or function of numba is resolved once for the same types of its arguments."""
    resolve = _function.get_call_type

    def resolve_once(self: Any, context: Any, args: Any, kws: Any) -> Any:
        key = (id(self), id(context), args, tuple(kws.items()))
        known = _resolved.get(key)
        if known is None:
            with _stack().enter(_rules_of_all()):
                found = resolve(self, context, args, kws)
            # with the function itself, so that its id is not given to another one
            known = _resolved[key] = (found, (self, context))
        return known[0]

    if resolve.__name__ == resolve_once.__name__:
        yield
        return
    _function.get_call_type = resolve_once
    try:
        yield
    finally:
        _function.get_call_type = resolve


def _rules_of_all() -> Any:
    """The rules by which a kernel is compiled, without those that its callers make.

    What it calls of numba is compiled once for each set of rules.
    """
    rules = _stack.top_or_none().copy()
    for rule in ("no_cpython_wrapper", "forceinline"):
        rules.discard(rule)
    return rules


@contextmanager
def _garbage_kept() -> Iterator[None]:
    """The search for garbage is put off: compiling makes many objects and little of that."""
    thresholds = gc.get_threshold()
    gc.set_threshold(max(thresholds[0], ALLOCATIONS), *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
