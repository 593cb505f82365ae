"""Mutation testing: does a test fail when a line is wrong?

    python tests/mutation/run.py map                  which tests execute which lines
    python tests/mutation/run.py run --jobs 2         try the sample; goes on where it was ended
    python tests/mutation/run.py report               what was killed, and who survives
    python tests/mutation/run.py keep                 write the verdicts down, to be checked in
    python tests/mutation/run.py stale --since main   verdicts that a change has made void
    python tests/mutation/run.py gate                 thirty known mutants that must be killed
    python tests/mutation/run.py clauses              clauses that do not notice they are broken
    python tests/mutation/run.py show ID              one mutant as a diff
    python tests/mutation/run.py try ID               one mutant, with what pytest says

See README.md here.
"""

import argparse
import contextlib
import difflib
import os
import signal
import subprocess
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.mutation import clauses, cover, records, trial
from tests.mutation.choose import choose
from tests.mutation.mutants import (
    SAMPLE,
    Mutant,
    difference,
    digest_of_test,
    files,
    first,
    folder,
    mutants,
    mutated,
    sample,
)
from tests.mutation.records import ALIVE, UNREACHED, Entry, Result

HERE: Final = Path(__file__).resolve().parent
TESTS: Final = ("tests/conformance", "tests/properties", "tests/reference", "tests/frozen",
                "tests/unit", "tests/nodes/test_machine.py", "tests/nodes/test_orders.py",
                "tests/nodes/test_board_file.py", "tests/nodes/test_faults.py",
                "tests/nodes/test_quiet_lines.py", "tests/nodes/test_recorded_host.py",
                "tests/nodes/test_asked_for_parts.py", "tests/nodes/test_reports_together.py",
                "tests/nodes/test_realtime.py", "tests/nodes/test_processes.py",
                "tests/nodes/test_snapshot.py",
                "tests/cpu", "tests/simulation/test_simulation.py", "tests/zenoh/test_session.py",
                "tests/zenoh/test_bus.py", "tests/zenoh/test_exchange.py",
                "tests/zenoh/test_posts.py", "tests/zenoh/test_security.py",
                "tests/zenoh/test_watching.py", "tests/zenoh/test_message_faults.py",
                "tests/e2e/test_rfc2217.py", "tests/e2e/test_report.py",
                "tests/e2e/test_metrics.py", "tests/e2e/test_attach.py",
                "tests/e2e/test_watching.py", "tests/e2e/test_control.py",
                )  # fmt: skip
LEFT_OUT: Final = (
    "tests/unit/native",
    "tests/unit/test_clauses.py", "tests/unit/test_repeat.py",
    "tests/unit/testing/test_robot.py",

)  # fmt: skip
"""Programs in C, links, and tests about tests: nothing of what is mutated, or in processes."""

PACKAGE: Final = "vbus"
CHOSEN: Final = 40.0
"""Seconds of processor time, as measured with coverage, of all tests chosen for a mutant."""
FIRST: Final = 2.0
"""Seconds of those tried first; most mutants go no further."""
FIRST_FILES: Final = 4
SUSPECTS: Final = 8
"""Tests that are asked of a changed mutant where there is no map: some ten seconds' worth."""
LEAST: Final = 10.0
MOST: Final = 60.0
FACTOR: Final = 4.0
"""Of what was measured: the limit of processor time, and its bounds in seconds."""
WANTED: Final = {"vbus/chips": 0.95}
ELSEWHERE: Final = 0.9
"""Part of the mutants that has to be killed."""
ELSE: Final = 3.0
"""Seconds of tests of other clauses that are asked where the clause's own have noticed nothing."""
GATE: Final = 30
CLAUSE_GATE: Final = 24
GATE_SECONDS: Final = 1.0
"""Longest test of the gate."""


class Bed:
    """Where things are, and what was asked for."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.root: Path = options.root.resolve()
        self.package: str = options.package
        self.build: Path = self.root / "build" / "mutation"
        self.map: Path = self.build / "map.json"
        self.results: Path = options.results or self.build / "results.jsonl"
        self.kept: Path = options.lists / "results.txt"
        self.budget: Path = options.lists / "stale.toml"
        self.survivors: Path = options.lists / "survivors.toml"
        self.gate: Path = options.lists / "gate.toml"
        self.answers: Path = self.build / "clauses.jsonl"
        self.unnoticed: Path = options.lists / "unnoticed.toml"
        self.clause_gate: Path = options.lists / "clause_gate.toml"

    def sample(self) -> list[Mutant]:
        """Return the mutants that were asked for."""
        options = self.options
        only = tuple(options.only or ())
        if only and options.sample:
            inside = [file for file in files(self.root, self.package) if file.startswith(only)]
            return first(self.root, inside, options.sample, options.seed)
        found = sample(self.root, options.sample or SAMPLE, options.seed, only or ("",))
        return [mutant for mutant in found if not only or mutant.file.startswith(only)]

    def changed(self) -> set[str]:
        """Return the files that have changed since a commit."""
        order = ("git", "diff", "--name-only", "--relative", self.options.since)
        done = subprocess.run(order, cwd=self.root, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(done.stderr.strip())
        return set(done.stdout.splitlines())

    @staticmethod
    def concerns(result: Result, changed: set[str]) -> bool:
        """Whether the mutant's file or that of the test that killed it is among those changed."""
        return bool({result.file, result.by.partition("::")[0]} & changed)

    def touched(self, known: dict[str, Result]) -> list[Mutant]:
        """Return the mutants that were asked for; with ``--since`` those that a change concerns."""
        if not self.options.since:
            return self.sample()
        changed = self.changed()
        theirs = {it.id: it.file for it in known.values() if self.concerns(it, changed)}
        if not self.options.only:
            self.options.only = [it for it in {*theirs.values(), *changed} if folder(it)] or ["-"]
        return [it for it in self.sample() if it.file in changed or it.id in theirs]

    def known(self) -> dict[str, Result]:
        """Return the verdicts that are checked in, and those found here since."""
        return records.read_kept(self.kept) | records.read_results(self.results)

    def find(self, name: str) -> Mutant:
        """Return the mutant of an id."""
        for file in files(self.root, self.package):
            for mutant in mutants(self.root, file, breaks=True):
                if mutant.id == name:
                    return mutant
        sys.exit(f"no mutant {name}: its line or its function has changed")

    def entry(self, mutant: Mutant, tests: Sequence[str] = ()) -> Entry:
        """Return a mutant as it is listed."""
        before, after = difference(self.root, mutant)
        return Entry(mutant.id, mutant.file, mutant.scope, before, after, "", tests)


# -- map ------------------------------------------------------------------------------------------


def do_map(bed: Bed) -> int:
    """Measure which tests execute which lines."""
    trial.warm(bed.root)
    os.chdir(bed.root)
    for path in bed.options.tests or _test_paths(bed.root):
        _share(1, lambda _, path=path: _measure(bed, path))
    found = cover.Map.load(bed.map)
    print(f"{len(found.tests)} tests, {sum(it.seconds for it in found.tests.values()):.0f} s")
    return 0


def _test_paths(root: Path) -> list[str]:
    """Return folders and files of tests; each runs in a process of its own."""
    paths = []
    for name in TESTS:
        path = root / name
        inner = sorted(path.glob("*")) if path.is_dir() else [path] if path.exists() else []
        for it in inner:
            if it.name.startswith("test_") or (it.is_dir() and list(it.glob("test_*.py"))):
                paths.append(it.relative_to(root).as_posix())
    return paths


def _measure(bed: Bed, path: str) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # pytest takes an exit for a failed test
    print(f"-- {path}", flush=True)
    tests = path.removesuffix("/")
    if tests in LEFT_OUT:
        return
    options = [*trial.OPTIONS, tests, *(f"--ignore={name}" for name in LEFT_OUT)]
    for name in cover.measure(bed.root, bed.package, tests, options, bed.map):
        print(f"not used, it does not pass: {name}")


# -- run ------------------------------------------------------------------------------------------


def do_run(bed: Bed) -> int:
    """Try the sample."""
    options = bed.options
    found = cover.Map.load(bed.map)
    number, count = (int(part) for part in options.shard.split("/"))
    known = bed.known()
    if not found.tests and not any(it.by for it in known.values()):
        sys.exit("no coverage map: run `map` first")
    chosen = sorted(bed.touched(known), key=lambda mutant: mutant.rank)[number - 1 :: count]
    todo = [it for it in chosen if _open(bed, it, known.get(it.id))][: options.most]
    print(f"{len(chosen)} mutants, {len(todo)} to try", flush=True)
    trial.warm(bed.root)
    _prune(bed, found)
    start = time.monotonic()
    _share(options.jobs, lambda part: _work(bed, found, known, todo[part :: options.jobs]))
    _verify(bed, {mutant.id for mutant in todo})
    print(f"{len(todo)} mutants in {time.monotonic() - start:.0f} s")
    return 0


def _open(bed: Bed, mutant: Mutant, result: Result | None) -> bool:
    if result is None or not result.holds(mutant, bed.root):
        return True
    return bed.options.again and result.verdict in ALIVE


def _share(jobs: int, work: Callable[[int], None]) -> None:
    """Do work in several processes; none outlives this one."""
    pids = []
    for part in range(jobs):
        pid = os.fork()
        if pid == 0:
            code = 1
            try:
                work(part)
                code = 0
            except Exception:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                os._exit(code)
        pids.append(pid)
    try:
        codes = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in pids]
    except BaseException:
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGTERM)
        raise
    if any(codes):
        sys.exit("a worker has failed")


def _prune(bed: Bed, found: cover.Map) -> None:
    """Forget tests that are there no more."""
    there = trial.collected(bed.root, sorted({name.partition("::")[0] for name in found.tests}))
    for name in found.tests.keys() - there:
        del found.tests[name]


def _work(bed: Bed, found: cover.Map, known: dict[str, Result], todo: Sequence[Mutant]) -> None:
    for mutant in todo:
        result = try_mutant(bed, found, mutant, _suspects(bed, found, known, mutant))
        if not found.tests and result.verdict in ALIVE:
            print(f"open     {mutant.id} {mutant.file}:{mutant.line}: run `map` first", flush=True)
            continue
        records.append(bed.results, result)
        print(f"{result.verdict:8} {result.cpu:6.2f} s {mutant.id} {mutant.file}:{mutant.line}"
              f" {result.by}", flush=True)  # fmt: skip


def _suspects(bed: Bed, found: cover.Map, known: dict[str, Result], mutant: Mutant) -> list[str]:
    """Return what has killed a mutant before; without a map, what has killed others close by."""
    own = known.get(mutant.id)
    names = [own.by] if own else []
    if not found.tests:
        others = [it for it in known.values() if it.file == mutant.file]
        others.sort(key=lambda it: it.scope != mutant.scope)
        names += [it.by for it in others]
    there = (name for name in dict.fromkeys(names) if digest_of_test(bed.root, name))
    return list(there)[:SUSPECTS]


def try_mutant(bed: Bed, found: cover.Map, mutant: Mutant, suspects: Sequence[str] = ()) -> Result:
    """Try one mutant: with usual suspects, a few tests, all chosen, all that Hypothesis draws."""
    tests = choose(bed.root, found, mutant, bed.options.seconds)
    source = mutated(bed.root, mutant)
    few = _few(found, tests)
    draw = [name for name in tests if found.tests[name].draws]
    stages = ((suspects, trial.FEW), (few, trial.FEW), (tests[len(few) :], trial.FEW), (draw, 0))
    cpu = 0.0
    verdict, by = "survived" if tests else UNREACHED, ""
    for names, examples in stages:
        if names:
            task = trial.Task(names, _limit(bed, found, names), mutant.file, source, examples)
            outcome = trial.attempt(bed.root, task)
            cpu += outcome.cpu
            verdict, by = outcome.verdict, outcome.by
            if verdict != "survived":
                break
    proof = digest_of_test(bed.root, by)
    return Result(mutant.id, mutant.digest, verdict, by, len(tests), round(cpu, 2), proof,
                  mutant.file, mutant.scope)  # fmt: skip


def _few(found: cover.Map, tests: Sequence[str]) -> list[str]:
    few: list[str] = []
    places: set[str] = set()
    seconds = 0.0
    for name in tests:
        places.add(name.partition("::")[0])
        seconds += found.tests[name].seconds
        if few and (seconds > FIRST or len(places) > FIRST_FILES):
            break
        few.append(name)
    return few


def _limit(bed: Bed, found: cover.Map, tests: Sequence[str]) -> float:
    measured = sum(found.tests[name].seconds for name in tests if name in found.tests)
    return min(MOST, max(bed.options.least, FACTOR * measured))


def _verify(bed: Bed, tried: set[str]) -> None:
    """See that what has killed mutants passes without a mutant; else its verdicts are void."""
    found = cover.Map.load(bed.map)
    results = records.read_results(bed.results)
    killers = sorted({it.by for it in results.values() if it.id in tried and it.by in found.tests})
    bad = set()
    while killers:
        task = trial.Task(killers, 600.0)
        outcome = trial.attempt(bed.root, task)
        if outcome.verdict == "survived":
            break
        if outcome.by not in killers:
            sys.exit(f"tests do not pass without a mutant: {outcome.verdict} {outcome.by}")
        bad.add(outcome.by)
        killers.remove(outcome.by)
    if bad:
        kept = [it for it in results.values() if it.by not in bad]
        bed.results.unlink()
        for result in kept:
            records.append(bed.results, result)
        sys.exit("\n".join(["fail without a mutant; what they killed is open again:", *bad]))


# -- report ---------------------------------------------------------------------------------------


def do_report(bed: Bed) -> int:
    """Say what was killed; fail if the list of survivors is not right."""
    chosen = bed.sample()
    listed = records.read_entries(bed.survivors)
    if bed.options.only:
        listed = [entry for entry in listed if entry.file.startswith(tuple(bed.options.only))]
    valid, problems, new = records.judge(bed.root, chosen, bed.known(), listed)
    rows: dict[str, list[Result]] = {}
    for mutant in chosen:
        if mutant.id in valid:
            whole = next((name for name in WANTED if mutant.file.startswith(name)), "")
            for row in (folder(mutant.file), f"all in {whole}" if whole else "all elsewhere"):
                rows.setdefault(row, []).append(valid[mutant.id])
    print(f"{'':24}{'tried':>7}{'killed':>8}{'timeout':>9}{'survived':>10}{'no test':>9}"
          f"{'killed':>9}")  # fmt: skip
    for name, found in sorted(rows.items(), key=lambda row: (row[0].startswith("all"), row[0])):
        counts = Counter(result.verdict for result in found)
        print(f"{name:24}{len(found):7}{counts['killed']:8}{counts['timeout']:9}"
              f"{counts['survived']:10}{counts[UNREACHED]:9}"
              f"{records.share(found):9.1%}")  # fmt: skip
        wanted = WANTED.get(name.removeprefix("all in "), ELSEWHERE)
        if name.startswith("all") and records.share(found) < wanted:
            problems.append(f"{name}: less than {wanted:.0%} are killed")
    seconds = sum(result.cpu for result in valid.values())
    print(f"{seconds:.0f} s of processor time, {seconds / max(1, len(valid)):.2f} s each\n")
    for mutant in new:
        before, after = difference(bed.root, mutant)
        print(f"{mutant.file}:{mutant.line}: {mutant.scope}: {mutant.operator} [{mutant.id}]"
              f" {valid[mutant.id].tests} tests\n  - {before}\n  + {after}")  # fmt: skip
    if bed.options.entries:
        for mutant in new:
            print(records.entry_text(bed.entry(mutant)))
    for problem in problems:
        print(problem)
    return bool(problems)


def do_keep(bed: Bed) -> int:
    """Write down the verdicts of the sample, to be checked in."""
    known = bed.known()
    valid = [(it, known[it.id]) for it in bed.sample()
             if it.id in known and known[it.id].holds(it, bed.root)
             and known[it.id].verdict != UNREACHED]  # fmt: skip
    records.keep(bed.kept, valid)
    records.write_budget(
        bed.budget, records.without_verdict(records.read_kept(bed.kept).values(), ())
    )
    print(f"{len(valid)} verdicts in {bed.kept}")
    return 0


def do_stale(bed: Bed) -> int:
    """Name the verdicts that a change has made void; fail if a room has too many."""
    kept = records.read_kept(bed.kept)
    gone = records.stale(bed.root, kept.values())
    if bed.options.since:
        changed = bed.changed()
        mine = [name for name in gone if bed.concerns(kept[name], changed)]
        print("\n".join(f"{name} {gone[name]}" for name in mine))
        print(f"{len(mine)} verdicts are void; `run --since {bed.options.since}` tries them again")
        return bool(mine)
    return bool(_over_budget(bed))


def _over_budget(bed: Bed) -> list[str]:
    """Say which rooms have too many mutants without a verdict."""
    kept = records.read_kept(bed.kept).values()
    gone = records.stale(bed.root, kept)
    now = records.without_verdict(kept, gone)
    over = records.over_budget(now, records.read_budget(bed.budget))
    print(f"{sum(now.values())} of {SAMPLE} mutants have no verdict of the code as it is,"
          f" {len(gone)} of them since it was tried")  # fmt: skip
    if over:
        print("\n".join([*over, 'See tests/mutation/README.md, "Stale verdicts".']))
    return over


# -- gate -----------------------------------------------------------------------------------------


def do_gate(bed: Bed) -> int:
    """Try the mutants of both gates; with ``--renew`` fill the first up from the results."""
    if bed.options.renew:
        return _renew(bed)
    entries = [*records.read_entries(bed.gate), *records.read_entries(bed.clause_gate)]
    if not entries:
        sys.exit(f"{bed.gate} is empty; fill it with --renew")
    by_id = {mutant.id: mutant for file in sorted({entry.file for entry in entries})
             if (bed.root / file).exists()
             for mutant in mutants(bed.root, file, breaks=True)}  # fmt: skip
    gone = [entry for entry in entries if entry.id not in by_id]
    for entry in gone:
        print(f"no longer applies: {entry.id} {entry.file}: {entry.before}")
    trial.warm(bed.root)
    tests = list(dict.fromkeys(name for entry in entries for name in entry.tests))
    start = time.monotonic()
    plain = trial.attempt(bed.root, trial.Task(tests, MOST))
    if plain.verdict != "survived":
        sys.exit(f"tests of the gate without a mutant: {plain.verdict} {plain.by}")
    there = [entry for entry in entries if entry.id in by_id]

    def work(part: int) -> None:
        alive = 0
        for entry in there[part :: bed.options.jobs]:
            mutant = by_id[entry.id]
            task = trial.Task(entry.tests, LEAST, mutant.file, mutated(bed.root, mutant))
            if trial.attempt(bed.root, task).verdict == "survived":
                alive += 1
                print(f"survives: {entry.id} {mutant.file}:{mutant.line}\n"
                      f"  - {entry.before}\n  + {entry.after}", flush=True)  # fmt: skip
        if alive:
            sys.exit(1)

    _share(bed.options.jobs, work)
    print(f"{len(there)} mutants killed in {time.monotonic() - start:.0f} s")
    return bool(gone) or (bed.package == PACKAGE and bool(_over_budget(bed)))


def _renew(bed: Bed) -> int:
    """Keep the mutants of the gate that still apply, and fill it up with others that were killed.

    A place in a function is preferred, in a folder and a file that have few.
    """
    results = records.read_results(bed.results)
    tests = cover.Map.load(bed.map).tests
    there = [it for file in files(bed.root, bed.package) for it in mutants(bed.root, file)]
    old = {entry.id: entry for entry in records.read_entries(bed.gate)}
    kept = [mutant for mutant in there if mutant.id in old]
    good = [
        mutant for mutant in there
        if mutant.id not in old and (it := results.get(mutant.id)) and it.holds(mutant, bed.root)
        and it.verdict == "killed" and it.by in tests and tests[it.by].seconds < GATE_SECONDS
    ]  # fmt: skip
    for _ in range(min(GATE - len(kept), len(good))):
        of_file = Counter(mutant.file for mutant in kept)
        of_folder = Counter(folder(mutant.file) for mutant in kept)
        best = min(good, key=lambda it: (of_folder[folder(it.file)], of_file[it.file], not it.runs,
                                         it.rank))  # fmt: skip
        good.remove(best)
        kept.append(best)
    kept.sort(key=lambda mutant: (mutant.file, mutant.line))
    rows = [old.get(it.id) or bed.entry(it, [results[it.id].by]) for it in kept]
    text = (
        "# Made by `run.py gate --renew`: mutants of all folders, and a test that kills each.\n\n"
    )
    bed.gate.write_text(text + "\n".join(map(records.entry_text, rows)))
    return 0


# -- clauses --------------------------------------------------------------------------------------


def do_clauses(bed: Bed) -> int:
    """Break what each clause asks for, and ask the clause's own tests."""
    options = bed.options
    tests = clauses.own_tests()
    found = [it for it in clauses.breaks(bed.root, options.each)
             if not options.only or set(options.only) & set(it.clauses)]  # fmt: skip
    number, count = (int(part) for part in options.shard.split("/"))
    found = found[number - 1 :: count]
    digests = {it.mutant.id: clauses.digest_of(bed.root, it, tests) for it in found}
    known = clauses.read_answers(bed.answers)
    todo = [it for it in found
            if (answer := known.get(it.mutant.id)) is None
            or answer.digest != digests[it.mutant.id]
            or (options.again and not answer.noticed)]  # fmt: skip
    print(f"{len(found)} mutants of {len({c for it in found for c in it.clauses})} clauses,"
          f" {len(todo)} to try", flush=True)  # fmt: skip
    if todo:
        trial.warm(bed.root)
        asked = sorted({name for it in todo for clause in it.clauses for name in tests[clause]})
        plain = trial.attempt(bed.root, trial.Task(asked, 900.0, examples=0))
        if plain.verdict not in ("survived", "missing"):  # of a test with cases the cases are there
            sys.exit(f"tests of clauses without a mutant: {plain.verdict} {plain.by}")
    lines = cover.Map.load(bed.map)

    def work(part: int) -> None:
        for it in todo[part :: options.jobs]:
            answer = _ask(bed, it, tests, digests[it.mutant.id], lines)
            clauses.append(bed.answers, answer)
            print(f"{answer.verdict:8} {it.mutant.id} {it.mutant.file}:{it.mutant.line}"
                  f" {' '.join(it.clauses)}: {' '.join(answer.noticed) or '-'} {answer.by}",
                  flush=True)  # fmt: skip

    _share(options.jobs, work)
    answers = clauses.read_answers(bed.answers)
    if options.renew:
        _renew_clauses(bed, found, answers)
    return _tell(bed, found, answers)


def _renew_clauses(
    bed: Bed, found: Sequence[clauses.Break], answers: dict[str, clauses.Answer]
) -> None:
    """Keep the mutants of the gate that still apply; fill it up with others that were noticed.

    Operators of our own are preferred, in a block of clauses that has few.
    """
    by_id = {it.mutant.id: it for it in found}
    old = {entry.id: entry for entry in records.read_entries(bed.clause_gate)}
    kept = [it for name, it in by_id.items() if name in old]
    good = [it for name, it in by_id.items()
            if name not in old and answers[name].noticed and "::" in answers[name].by
            and answers[name].verdict == "killed"]  # fmt: skip

    def order(it: clauses.Break) -> tuple[int, bool, str]:
        block = clauses.block(it)
        return sum(clauses.block(one) == block for one in kept), not it.own, it.mutant.rank

    for _ in range(min(CLAUSE_GATE - len(kept), len(good))):
        best = min(good, key=order)
        good.remove(best)
        kept.append(best)
    kept.sort(key=lambda it: (it.mutant.file, it.mutant.line))
    rows = [old.get(it.mutant.id) or bed.entry(it.mutant, [answers[it.mutant.id].by])
            for it in kept]  # fmt: skip
    text = "# Made by `run.py clauses --renew`: broken clauses, and a test that notices each.\n\n"
    bed.clause_gate.write_text(text + "\n".join(map(records.entry_text, rows)))


def _ask(
    bed: Bed,
    it: clauses.Break,
    tests: dict[str, tuple[str, ...]],
    digest: str,
    lines: cover.Map,
) -> clauses.Answer:
    """Ask the tests of a mutant's clauses; if none fails, those of other clauses."""
    asked = list(dict.fromkeys(name for clause in it.clauses for name in tests[clause]))
    mutant = it.mutant
    source = mutated(bed.root, mutant)
    task = trial.Task(asked, LEAST, mutant.file, source, 0, whole=True)
    outcome = trial.attempt(bed.root, task)
    noticed = [
        clause for clause in it.clauses
        if any(clauses.proves(proof, failed)
               for proof in tests[clause] for failed in outcome.failed)
    ]  # fmt: skip
    if outcome.verdict != "survived" and (not outcome.failed or "collection" in outcome.failed):
        noticed = list(it.clauses)
    by = outcome.by
    if not noticed:
        own = {name for names in tests.values() for name in names}
        others = [name for name in choose(bed.root, lines, mutant, ELSE)
                  if name.partition("[")[0] in own]  # fmt: skip
        if others:
            by = trial.attempt(bed.root, trial.Task(others, LEAST, mutant.file, source)).by
    return clauses.Answer(mutant.id, digest, outcome.verdict, noticed, by)


def _tell(bed: Bed, found: Sequence[clauses.Break], answers: dict[str, clauses.Answer]) -> int:
    """Say which clauses do not notice that they are broken."""
    options = bed.options
    entries = {entry.id: entry for entry in records.read_entries(bed.unnoticed)}
    listed = entries.keys() | {entry.id for entry in records.read_entries(bed.survivors)}
    problems = []
    for name, those in clauses.silent(found, answers).items():
        if not all(it.mutant.id in listed for it in those):
            problems.append(f"{name} notices none of {len(those)} mutants of its code")
    elsewhere = 0
    for it in found:
        answer = answers[it.mutant.id]
        if answer.noticed or it.mutant.id in listed:
            continue
        elsewhere += bool(answer.by)
        what = "noticed by" if answer.by else "noticed by no clause: "
        before, after = difference(bed.root, it.mutant)
        print(f"{it.mutant.file}:{it.mutant.line}: {it.mutant.scope}: {it.mutant.operator}"
              f" [{it.mutant.id}] {' '.join(it.clauses)}: {what} {answer.by}\n"
              f"  - {before}\n  + {after}")  # fmt: skip
        if not answer.by:
            problems.append(f"{it.mutant.file}: no test of any clause notices {it.mutant.id}")
            if options.entries:
                print(records.entry_text(bed.entry(it.mutant)))
    ids = {it.mutant.id for it in found}
    for entry in entries.values():
        if entry.id in ids and answers[entry.id].noticed:
            problems.append(f"{entry.file}: {entry.id} is listed, but noticed")
        elif entry.id not in ids and options.shard == "1/1" and not options.only:
            problems.append(f"{entry.file}: {entry.id} is listed, but is not among the mutants")
    noticed = sum(bool(answers[it.mutant.id].noticed) for it in found)
    print(f"{noticed} of {len(found)} are noticed by tests of their clauses, {elsewhere} by tests"
          " of other clauses only")  # fmt: skip
    print("\n".join(problems))
    return bool(problems)


# -- one mutant -----------------------------------------------------------------------------------


def do_show(bed: Bed) -> int:
    """Print a mutant as a diff."""
    mutant = bed.find(bed.options.id)
    old, new = (bed.root / mutant.file).read_text(), mutated(bed.root, mutant)
    lines = difflib.unified_diff(
        old.splitlines(), new.splitlines(), f"a/{mutant.file}", f"b/{mutant.file}", lineterm=""
    )
    print("\n".join([f"{mutant.id} {mutant.operator} in {mutant.scope}", *lines]))
    return 0


def do_try(bed: Bed) -> int:
    """Try one mutant and show what pytest says."""
    do_show(bed)
    mutant = bed.find(bed.options.id)
    found = cover.Map.load(bed.map)
    tests = bed.options.tests or choose(bed.root, found, mutant, CHOSEN)
    trial.warm(bed.root)
    log = bed.build / f"{mutant.id}.log"
    log.unlink(missing_ok=True)
    task = trial.Task(tests, MOST, mutant.file, mutated(bed.root, mutant), 0, log)
    outcome = trial.attempt(bed.root, task)
    print(log.read_text())
    print(f"{outcome.verdict} {outcome.by} ({len(tests)} tests, {outcome.cpu} s)")
    return outcome.verdict == "survived"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--root", type=Path, default=HERE.parents[1], help="of the checkout")
    parser.add_argument("--package", default=PACKAGE)
    parser.add_argument("--lists", type=Path, default=HERE, help="folder of the checked-in lists")
    parser.add_argument("--results", type=Path, help="build/mutation/results.jsonl")
    orders = parser.add_subparsers(required=True)
    made = {}
    for do in (do_map, do_run, do_report, do_keep, do_stale, do_gate, do_clauses, do_show, do_try):
        name = do.__name__.removeprefix("do_")
        made[name] = orders.add_parser(name, help=(do.__doc__ or "").partition("\n")[0])
        made[name].set_defaults(do=do)
    for name in ("run", "report", "keep"):
        made[name].add_argument("--sample", type=int, metavar="N", help=f"how many ({SAMPLE})")
        made[name].add_argument("--seed", default="", help="another sample")
        made[name].add_argument(
            "--only",
            action="append",
            metavar="PATH",
            help="of the sample what is here; with --sample the first N here",
        )
    for name in ("gate", "clauses"):
        made[name].add_argument("--renew", action="store_true", help="fill it up from the results")
    for name in ("run", "gate", "clauses"):
        made[name].add_argument("--jobs", type=int, default=2)
    for name in ("run", "clauses"):
        made[name].add_argument("--shard", default="1/1", metavar="I/N")
        made[name].add_argument("--again", action="store_true", help="survivors once more")
    for name in ("report", "clauses"):
        made[name].add_argument("--entries", action="store_true", help="survivors as TOML rows")
    for name in ("run", "stale"):
        made[name].add_argument("--since", default="", metavar="REF",
                                help="only what files changed since a commit concern")  # fmt: skip
    made["run"].add_argument("--most", type=int, metavar="N", help="try no more than so many")
    made["clauses"].add_argument("--each", type=int, default=clauses.EACH, metavar="N",
                                 help=f"mutants of a clause ({clauses.EACH})")  # fmt: skip
    made["clauses"].add_argument("--only", action="append", metavar="CLAUSE")
    for name in ("show", "try"):
        made[name].add_argument("id")
    made["map"].add_argument("tests", nargs="*", help="paths; what is known of others stays")
    made["run"].add_argument("--seconds", type=float, default=CHOSEN, metavar="S",
                             help=f"tests to choose for each ({CHOSEN:.0f})")  # fmt: skip
    made["run"].add_argument("--least", type=float, default=LEAST, metavar="S",
                             help="seconds of processor time each mutant may use")  # fmt: skip
    made["try"].add_argument("tests", nargs="*", help="node ids, instead of those of the map")
    return parser


def main() -> int:
    """Do what the command line says."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    options = _parser().parse_args()
    return int(options.do(Bed(options)))


if __name__ == "__main__":
    sys.exit(main())
