"""`bsmap warmup`: compile ahead of the first run."""

from __future__ import annotations

from time import perf_counter

from bsmap_cli.cli.compiled_code import check_kept
from bsmap_cli.cli.options import Json, TalkFlags
from bsmap_cli.cli.report import print_json, print_text


def run(*, talk: TalkFlags, json: Json = False) -> None:
    """Compile the inner loops ahead, so that the first run need not.

    For images, CI and shared machines. Compiled code is kept beside the package, or where that
    cannot be written in the user's cache folder; the environment variable NUMBA_CACHE_DIR names
    another folder. It is made anew after an update of bsmap or numba and on another kind of
    processor. Once all is compiled, the command only looks after it.

    \b
    Example:
      bsmap warmup
      bsmap warmup --json
    """
    began = perf_counter()
    check_kept()
    from bsmap_cli.pipeline.warm_up import warm_up

    voice = talk.talk()
    voice.note("compiling what is not compiled yet: the first time that takes a while")
    done = warm_up()
    seconds = perf_counter() - began
    if json:
        print_json(
            {
                "kernels": done.kernels,
                "compiled": done.compiled,
                "seconds": round(seconds, 2),
                "folder": str(done.folder),
            }
        )
    elif voice.level >= 0:
        what = f"{done.compiled} compiled" if done.compiled else "all compiled before"
        print_text(f"{done.kernels} kernels, {what}, in {seconds:.1f} s; kept in {done.folder}\n")
