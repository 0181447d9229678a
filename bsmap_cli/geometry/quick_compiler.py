"""What numba's compiler does for any program and these kernels do not need, left out.

Half of what it takes to compile them is numba's own Python code. Here it skips the passes for
closures, inlining and parallel loops, resolves each operator once for the same types, and makes
machine code of what Python calls alone: what only compiled code calls is optimised where it is
compiled into its callers. The rules of `compiled.py` stand, and the results are the same.

This knows more of numba than it documents. Where numba is newer than what it was tried with, or
differs otherwise, `quick_compilers` has none and the kernels are compiled as numba does by itself,
which takes longer.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numba

TRIED = ((0, 61), (0, 68))
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


def quick_compilers() -> tuple[type[Any] | None, type[Any] | None]:
    """The compilers of what Python calls and of what only compiled code calls, if there are any."""
    release = tuple(int(number) for number in numba.__version__.split(".")[:2])
    if not TRIED[0] <= release <= TRIED[1]:
        return None, None
    try:
        return _compilers()
    except (ImportError, AttributeError):
        return None, None


def _compilers() -> tuple[type[Any], type[Any]]:
    compiler: Any = import_module("numba.core.compiler")
    machinery: Any = import_module("numba.core.compiler_machinery")
    lowering: Any = import_module("numba.core.typed_passes").NativeLowering
    library: Any = import_module("numba.core.codegen").JITCodeLibrary

    class PartLibrary(library):  # type: ignore[misc]
        """Code to be linked into its callers, and never into the process."""

        def _optimize_final_module(self) -> None:
            pass

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            self._finalized = True

        def get_pointer_to_function(self, name: str) -> int:
            self._ensure_finalized()
            return 0

        @property
        def codegen(self) -> Any:
            return Nowhere()

    class Nowhere:
        """In place of a process's code: there is no variable to be set in it."""

        def set_env(self, name: str, environment: object) -> None:
            pass

    @machinery.register_pass(mutates_CFG=False, analysis_only=True)
    class ChoosePartLibrary(machinery.AnalysisPass):  # type: ignore[misc]
        _name = "choose_part_library"

        def __init__(self) -> None:
            machinery.AnalysisPass.__init__(self)

        def run_pass(self, state: Any) -> bool:
            name = state.func_id.func_qualname
            state.library = PartLibrary(state.targetctx.codegen(), name)
            state.library.enable_object_caching()
            return False

    class QuickCompiler(compiler.CompilerBase):  # type: ignore[misc]
        before_lowering: tuple[Any, ...] = ()

        def define_pipelines(self) -> list[Any]:
            whole = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
            quick = machinery.PassManager("quick")
            self.state.type_annotation = ""
            for made, text in whole.passes:
                if made is lowering:
                    for extra in self.before_lowering:
                        quick.add_pass(extra, "")
                if made._name not in NEEDLESS:
                    quick.add_pass(made, text)
            quick.finalize()
            return [quick]

        def _compile_core(self) -> Any:
            with _typing_remembered(), _garbage_kept():
                return super()._compile_core()

    class QuickPartCompiler(QuickCompiler):
        before_lowering = (ChoosePartLibrary,)

    return QuickCompiler, QuickPartCompiler


_resolved: dict[Any, tuple[Any, Any]] = {}


@contextmanager
def _typing_remembered() -> Iterator[None]:
    """An operator or function of numba is resolved once for the same types of its arguments."""
    function: Any = import_module("numba.core.types.functions").BaseFunction
    resolve = function.get_call_type

    def resolve_once(self: Any, context: Any, args: Any, kws: Any) -> Any:
        key = (id(self), id(context), args, tuple(kws.items()))
        known = _resolved.get(key)
        if known is None:
            # with the function itself, so that its id is not given to another one
            known = _resolved[key] = (resolve(self, context, args, kws), (self, context))
        return known[0]

    if resolve.__name__ == resolve_once.__name__:
        yield
        return
    function.get_call_type = resolve_once
    try:
        yield
    finally:
        function.get_call_type = resolve


@contextmanager
def _garbage_kept() -> Iterator[None]:
    """The search for garbage is put off: compiling makes many objects and little of that."""
    thresholds = gc.get_threshold()
    gc.set_threshold(max(thresholds[0], ALLOCATIONS), *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
