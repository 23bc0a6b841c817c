"""Runs the tests that reach a change, one change at a time, until one fails."""
import os
import re
import resource
import shutil
import subprocess
import tempfile
import time

MEMORY = 8 << 30  # bytes of address space: a change may allocate without end
MIN_SECONDS = 10  # of processor time, and ten times as long as without the change
FIRST_TESTS = 1.0  # processor seconds of the quickest tests, which run before the others


class Test:
    def __init__(self, name, seconds, reached):
        self.name, self.seconds, self.reached = name, seconds, reached


class Trials:
    """`whole`: programs without GoogleTest, with their arguments; each is one test. `budget`: the processor seconds of a
    program's tests for one change, the quickest tests first; None: all."""

    def __init__(self, work, names, whole, budget):
        self.work, self.names, self.whole, self.budget = work, names, whole, budget
        self.tests = {}
        self.skipped = []

    def start(self, program, words, seconds, **environment):
        """Returns the exit status (None: out of time) and the output."""
        folder = tempfile.mkdtemp(dir=self.work)
        environment = dict(os.environ, TMPDIR=folder, RC_PARAMS="seed=1", **environment)

        def limit():
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 2))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

        log = os.path.join(folder, "output")
        try:
            with open(log, "wb") as out:
                running = subprocess.Popen([str(self.work / "bin" / program), *words], cwd=folder, env=environment,
                                           stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                                           preexec_fn=limit, start_new_session=True)
                try:
                    status = running.wait(timeout=60 + 10 * seconds)
                except subprocess.TimeoutExpired:
                    os.killpg(running.pid, 9)
                    running.wait()
                    status = None
            with open(log, errors="replace") as read:
                return status, read.read()
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def measure(self):
        """Runs everything once without a change: what each test reaches, and how long it takes."""
        for program in self.names:
            reach = self.work / f"{program}.reach"
            reach.unlink(missing_ok=True)
            started = time.process_time()
            if program in self.whole:
                status, output = self.start(program, self.whole[program], 3600)
                self.tests[program] = [Test(program, 60.0, None)] if status == 0 else []
                if status != 0:
                    self.skipped.append(program)
                continue
            status, output = self.start(program, [], 3600, NODAL_REACH=str(reach))
            tests = []
            for line in reach.read_text().splitlines() if reach.exists() else []:
                outcome, name, seconds, *numbers = line.split()
                if outcome == "passed":
                    tests.append(Test(name, float(seconds), {int(number) for number in numbers}))
                else:
                    self.skipped.append(name)
            self.tests[program] = sorted(tests, key=lambda test: test.seconds)
            if status not in (0, 1):
                self.skipped.append(f"{program} (ended with {status})")

    def reaching(self, program, number):
        return [test for test in self.tests[program] if test.reached is None or number in test.reached]

    def reached(self, number):
        return any(self.reaching(program, number) for program in self.names)

    def noticed_by(self, number):
        """What noticed the change, or None."""
        for program in self.names:
            tests = self.reaching(program, number)
            if program in self.whole:
                status, _ = self.start(program, self.whole[program], 600, NODAL_MUTANT=str(number))
                if status != 0:
                    return program
                continue
            total, first, then = 0.0, [], []
            for test in tests:
                total += test.seconds
                if total < FIRST_TESTS or not first:
                    first.append(test)
                elif self.budget is None or total < self.budget:
                    then.append(test)
            for group in (first, then):
                noticed = group and self.group_notices(program, group, number)
                if noticed:
                    return noticed
        return None

    def group_notices(self, program, tests, number):
        seconds = MIN_SECONDS + 10 * sum(test.seconds for test in tests)
        names = ":".join(test.name for test in tests)
        status, output = self.start(program, ["--gtest_fail_fast", "--gtest_brief=0", f"--gtest_filter={names}"],
                                    seconds, NODAL_MUTANT=str(number))
        if status == 0:
            return None
        failed = re.search(r"\[  FAILED  \] ([\w/.]+)", output)
        if failed:
            return failed.group(1)
        begun = re.findall(r"\[ RUN      \] ([\w/.]+)", output)
        how = "out of time" if status in (None, -24, -9) else "the program ends"
        return f"{begun[-1] if begun else program} ({how})"
