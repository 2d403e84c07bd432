"""python -m tests.adversary.fuzz [--target NAME] [--runs N] [--seed N] [--corpus FOLDER]

Coverage-guided: an input that reaches a new branch of the project's Python is kept and changed on.
Half of the changes know the form of what they change (`fuzz_targets`), half are libFuzzer's own.
Effort is counted in runs, so that a seed is the same on any computer. `pip install --group fuzz`.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import atheris
except ImportError:
    raise SystemExit("atheris is not here: pip install --group fuzz") from None

NAMES = ("formulas", "words", "machines", "mappings", "tables", "hdf5", "mat")
SLOWEST = 60  # s for one input: more is a hang
LONGEST = 20_000  # bytes of one input


def main() -> int:
    """Each target in a process of its own; 1 where one of them failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.adversary.fuzz", description=__doc__)
    parser.add_argument(
        "--target", action="append", choices=NAMES, help="repeatable; all unless given"
    )
    parser.add_argument("--runs", type=int, default=20_000, help="inputs of each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--corpus", type=Path, help="where inputs that reached something new are kept"
    )
    given = parser.parse_args()
    folder = given.corpus or Path(tempfile.mkdtemp(prefix="corpus-"))
    failed = 0
    print(f"{'target':<12} {'inputs':>8} {'branches':>9} {'failed':>7}")
    for name in given.target or NAMES:
        own = folder / name
        own.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "tests.adversary.fuzz", "--one", name, f"-runs={given.runs}",
                   f"-seed={given.seed}", f"-max_len={LONGEST}", f"-timeout={SLOWEST}", "-print_final_stats=1",
                   f"-artifact_prefix={folder}/{name}-", str(own)]  # fmt: skip
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False
        )
        lines = done.stderr.splitlines()
        reached = [line.split("cov: ")[1].split()[0] for line in lines if "cov: " in line]
        tried = [line.rpartition(" ")[2] for line in lines if "number_of_executed_units" in line]
        wrong = done.returncode != 0
        print(
            f"{name:<12} {(tried or ['?'])[-1]:>8} {(reached or ['?'])[-1]:>9} {wrong:>7}",
            flush=True,
        )
        if wrong:
            failed += 1
            print("\n".join(f"    {line[:200]}" for line in lines[-40:]), flush=True)
    return int(failed > 0)


def one(name: str, arguments: list[str]) -> None:
    """Fuzz a target in this process, which libFuzzer ends."""
    # an editable installation has a finder of its own, which hides the source from the instruments
    sys.meta_path[:] = [f for f in sys.meta_path if "_editable" not in type(f).__module__]
    sys.path.insert(0, str(Path(__file__).parents[2] / "python"))
    with atheris.instrument_imports(include=["dualdrive"]):
        from tests.adversary.fuzz_targets import TARGETS, attempt
    target = TARGETS[name]
    corpus = Path(arguments[-1])
    for k, seed in enumerate(target.seeds()):
        (corpus / f"seed-{k}").write_bytes(seed)

    def changed(data: bytes, longest: int, seed: int) -> bytes:
        chance = random.Random(seed)
        if chance.random() < 0.5:
            return bytes(atheris.Mutate(data, longest))
        return target.change(data, chance)[:longest]

    atheris.Setup(
        [sys.argv[0], *arguments], lambda data: attempt(target, data), custom_mutator=changed
    )
    atheris.Fuzz()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(sys.argv[2], sys.argv[3:])
    else:
        raise SystemExit(main())
