"""Builds test programs from a changed copy of a room's sources, beside a build of the tree that stays as it is.

Only changed sources, and those that include a changed header, are compiled again. Their objects replace the original ones
in the command that links a program, or in a copy of the library that holds them.
"""
import fcntl
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run(words, **options):
    return subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          **options)


def fail(message):
    sys.exit(f"tests/mutants/run: {message}")


class Build:
    """The build of the tree that the programs are linked from."""

    def __init__(self, root, folder, jobs):
        self.root, self.folder, self.jobs = root, folder, jobs
        commands = folder / "compile_commands.json"
        if not commands.exists():
            fail(f"{folder} is not configured; run: cmake --preset release")
        self.commands = {}
        for entry in json.loads(commands.read_text()):
            self.commands.setdefault(os.path.relpath(entry["file"], root), shlex.split(entry["command"]))
        self.in_batches = any("unity_" in path for path in self.commands)

    def ninja(self, *words):
        done = run(["ninja", "-C", self.folder, *words])
        if done.returncode != 0:
            fail(f"ninja {' '.join(words)} failed:\n{done.stdout[-4000:]}")
        return done.stdout

    def make(self, targets):
        """Builds the programs as they are. Rooms may run beside each other; this part of them may not."""
        with open(self.folder / "mutants.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            self.ninja(f"-j{self.jobs}", *targets)

    def link_command(self, program):
        """The words that link bin/PROGRAM, from those that build it."""
        for line in reversed(self.ninja("-t", "commands", program).splitlines()):
            for command in line.split(" && "):
                if f" -o bin/{program} " in command:
                    return shlex.split(command)
        fail(f"{self.folder} has no program {program}")

    def headers_of(self, objects):
        """For each object, the files that it was compiled from, relative to the tree."""
        found, current = {}, None
        for line in self.ninja("-t", "deps", *objects).splitlines():
            if line.startswith(" "):
                found[current].add(os.path.relpath(os.path.realpath(self.folder / line.strip()), self.root))
            elif ":" in line:
                current = line.split(":")[0]
                found[current] = set()
        return found


class Programs:
    """The room's test programs with changed sources."""

    def __init__(self, build, names, unit, sources, work, whole):
        self.build, self.names, self.unit = build, names, unit
        self.sources, self.work, self.whole = sources, work, whole
        if build.in_batches and any(path.endswith(".cpp") and path not in build.commands for path in sources):
            fail(f"{build.folder} was configured with NODAL_UNITY; configure it without")
        self.links = {name: build.link_command(name) for name in names}
        self.tree = work / "tree"

    def try_to_make(self, changes):
        """Compiles and links with these changes. Returns those that do not compile; then nothing is linked."""
        by_path, in_lines = {}, {}
        for change in changes:
            by_path.setdefault(change.path, []).append(change)
        for path, source in self.sources.items():
            out = self.tree / path
            if path not in by_path:
                out.unlink(missing_ok=True)
                continue
            text, in_lines[path] = source.changed(by_path[path])
            out.parent.mkdir(parents=True, exist_ok=True)
            if not out.exists() or out.read_text() != text:
                out.write_text(text)
        needed = self.to_compile(by_path)
        refused = set()
        for path, target in needed:
            refused |= self.compile(path, target, in_lines)
        if not refused:
            self.link(needed)
        return [change for change in changes if change.number in refused]

    def to_compile(self, changed):
        """(source, object) for all sources of room and programs that are changed, or include what is changed."""
        headers = {path for path in changed if path.endswith(".h")}
        # A source that is not in this build, such as the kernel of another processor, is not compiled; nothing reaches it.
        paths = [path for path in changed if path in self.build.commands]
        if headers:
            own = {path for path in self.sources if path in self.build.commands}
            for name in self.unit:
                own |= {self.source_of(word) for word in self.links[name] if word.endswith(".cpp.o")}
            objects = {self.object_of(path): path for path in own if path in self.build.commands}
            for name, files in self.build.headers_of(objects).items():
                if name in objects and files & headers:
                    paths.append(objects[name])
        return [(path, self.work / "objects" / f"{path}.o") for path in dict.fromkeys(paths)]

    def object_of(self, path):
        words = self.build.commands[path]
        return words[words.index("-o") + 1]

    def source_of(self, name):
        return next((path for path in self.build.commands if self.object_of(path) == name), name)

    def compile(self, path, target, in_lines):
        """Returns the numbers of changes that the compiler refuses. The standard library checks its indices, so that a
        change which reads one element too many is noticed, as it is by `tests/run --asan`."""
        words = list(self.build.commands[path])
        words[words.index("-o") + 1] = str(target)
        source = self.tree / path if (self.tree / path).exists() else self.build.root / path
        words[words.index("-c") + 1] = str(source)
        target.parent.mkdir(parents=True, exist_ok=True)
        compiler = next(i for i, word in enumerate(words) if word.startswith("-"))
        words[compiler:compiler] = ["-I", str(self.tree), "-include", str(HERE / "switch.h")]
        done = run(words + ["-O1", "-D_GLIBCXX_ASSERTIONS", "-w", "-fmax-errors=0", "-fno-diagnostics-show-caret"], cwd=self.build.folder)
        if done.returncode == 0:
            return set()
        refused = set()
        for file, line in re.findall(r"([^\s:]+):(\d+):\d+:", done.stdout):
            place = os.path.relpath(os.path.realpath(self.build.folder / file), self.tree)
            refused |= in_lines.get(place, {}).get(int(line), set())
        if not refused:
            fail(f"{path} does not compile with its changes:\n{done.stdout[:4000]}")
        return refused

    def link(self, compiled):
        compiler = [word for word in next(iter(self.build.commands.values())) if not word.endswith("ccache")][0]
        own = [self.work / "objects" / "switch.o", self.work / "objects" / "reach.o"]
        for target in own:
            source = HERE / f"{target.stem}.cpp"
            if not target.exists() or target.stat().st_mtime < max(source.stat().st_mtime,
                                                                   (HERE / "switch.h").stat().st_mtime):
                done = run([compiler, "-std=c++20", "-O2", "-fPIC", "-c", source, "-o", target])
                if done.returncode != 0:
                    fail(done.stdout)
        (self.work / "bin").mkdir(exist_ok=True)
        replaced = self.with_objects(compiled)
        for name, words in self.links.items():
            words = [str(replaced.get(word, word)) for word in words]
            at = words.index("-o")
            words[at + 1] = str(self.work / "bin" / name)
            last = max(i for i, word in enumerate(words) if word.endswith(".o"))
            words[last + 1:last + 1] = [str(target) for target in (own if name not in self.whole else own[:1])]
            done = run(words, cwd=self.build.folder)
            if done.returncode != 0:
                fail(f"{name} does not link with its changes:\n{done.stdout[-4000:]}")

    def with_objects(self, compiled):
        """What stands in the place of objects and libraries of the build."""
        replaced, members = {}, {}
        for path, target in compiled:
            name = self.object_of(path)
            replaced[name] = target
            folder, _, rest = name.partition("/CMakeFiles/")
            library = f"{folder}/lib{rest.partition('.dir/')[0]}.a"
            if (self.build.folder / library).exists():
                members.setdefault(library, []).append(target)
        for library, targets in members.items():
            replaced[library] = self.work / "libraries" / Path(library).name
            replaced[library].parent.mkdir(exist_ok=True)
            shutil.copyfile(self.build.folder / library, replaced[library])
            done = run(["ar", "r", replaced[library], *targets])
            if done.returncode != 0:
                fail(done.stdout)
        return replaced
