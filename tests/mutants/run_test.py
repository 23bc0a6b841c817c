"""The tests of tests/mutants/run: run_test.py BUILD, the folder of a build that has test_planted."""
import hashlib
import subprocess
import sys
import unittest
from pathlib import Path

sys.dont_write_bytecode = True

import unseen
from changes import Source, by_seed

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BUILD = Path(sys.argv.pop()).resolve()


def changes_of(body):
    return Source("a.cpp", f"int f() {{\n{body}\n}}\n")


def named(body):
    return [change.what for change in changes_of(body).changes]


def with_only(body, wanted):
    """The body with a switch for each of these changes."""
    source = changes_of(body)
    changes = [next(change for change in source.changes if change.what == what) for what in wanted]
    for number, change in enumerate(changes, 1):
        change.number = number
    return source.changed(changes)[0].replace("::nodal::mutants::", "")


def only(body, what):
    return with_only(body, [what])


def contents(folder):
    return {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.rglob("*") if path.is_file()}


class Command(unittest.TestCase):
    def run_planted(self, *words):
        return subprocess.run([HERE / "run", "--room", "planted", "--build", BUILD, "--count", "100", *words],
                              capture_output=True, text=True)

    def test_a_planted_gap__is_named_and_the_tree_stays_as_it_is(self):
        before = contents(ROOT / "tests")
        done = self.run_planted()
        self.assertEqual(contents(ROOT / "tests"), before)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        gap = done.stdout[done.stdout.index("Nothing noticed:"):]
        self.assertIn("fare.cpp:6: < becomes <=\n", gap)
        self.assertIn("fare.cpp:6: the early return is never taken\n", gap)
        self.assertEqual(gap.count("fare.cpp:"), 2, gap)
        self.assertIn("| planted | 1 | 7 | 0 | 5 | 71 |", gap)

    def test_enough_is_noticed__it_ends_well(self):
        self.assertEqual(self.run_planted("--wanted", "70").returncode, 0)

    def test_no_room_or_an_unknown_one__says_which_there_are(self):
        for words in ([], ["--room", "attic"]):
            done = subprocess.run([HERE / "run", *words], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2)
        self.assertIn("protocol", done.stderr)


class Changes(unittest.TestCase):
    def test_operators_conditions_and_early_returns__are_found(self):
        self.assertEqual(named("if (a && b) return 1;"),
                         ["the condition is negated", "the early return is never taken", "&& becomes ||"])
        self.assertEqual(named("if (a) {\ng();\nreturn 1;\n}\nh();"),
                         ["the condition is negated", "the early return is never taken"])
        self.assertEqual(named("x = y % 3;"), ["% becomes /"])
        self.assertEqual(named("NODAL_TRY(f(a));"), ["the error is not passed on"])
        self.assertEqual(named("x -= y;"), ["-= becomes +="])
        self.assertEqual(named("x = !y ? 1 : 2;"), ["! is dropped", "the choice is negated"])

    def test_what_looks_like_an_operator__is_left_alone(self):
        for body in ("std::vector<int> a;", "const Foo& b = *c;", "auto&& d = -e;", "f(&g, *h);", 'x = "a" + y;',
                     "static_assert(a < b);", "constexpr int i = 2 * 3;", "NODAL_ASSERT(a < b);", "// a < b",
                     "std::map<int, std::vector<int>> j;", "if constexpr (kLarge) g();", 'g("a < b");', "case A + 1: g();",
                     "Staged<a == b ? 1 : 0> c;"):
            self.assertEqual(named(body), [], body)

    def test_operands__end_where_precedence_says(self):
        self.assertIn("x = (on(1) ? (a - b * c) : (a + b * c));", only("x = a + b * c;", "+ becomes -"))
        self.assertIn("x = (on(1) ? (a - b + c) : (a - b - c));",
                      only("x = a - b - c;", "- becomes + (number 2 of the line)"))
        self.assertIn("return (on(1) ? (f(a, b) <= g<int>(c)) : (f(a, b) < g<int>(c))) && d;",
                      only("return f(a, b) < g<int>(c) && d;", "< becomes <="))

    def test_changes_within_changes__are_all_switched(self):
        self.assertIn("x = (on(1) ? (a || (on(2) ? (b <= c) : (b < c))) : (a && (on(2) ? (b <= c) : (b < c))));",
                      with_only("x = a && b < c;", ["&& becomes ||", "< becomes <="]))

    def test_a_condition_with_a_declaration__keeps_it(self):
        self.assertIn("if (auto e = f(); static_cast<bool>(e) && !on(1)) return e;",
                      only("if (auto e = f()) return e;", "the early return is never taken"))

    def test_an_error_that_is_passed_on__is_kept_back(self):
        self.assertIn("NODAL_TRY([&]() -> ::nodal::Status { auto nodal_result = (f()); if (nodal_result || on(1)) return {}; "
                      "return ::nodal::fail(nodal_result.error()); }());",
                      only("NODAL_TRY(f());", "the error is not passed on"))

    def test_lines__stay_where_they_are(self):
        text = only("x = a &&  // why\n    b;\ny = 1;", "&& becomes ||")
        self.assertEqual(text.split("\n")[1:4], ["x = (on(1) ? (a || b) : (a && b))", ";", "y = 1;"])

    def test_another_line_in_the_file__changes_no_choice(self):
        one, other = (Source("a.cpp", text) for text in ("int f() {\nx = a + b;\ny = a - b;\n}\n",
                                                         "int f() {\ng();\nx = a + b;\ny = a - b;\n}\n"))
        self.assertEqual([change.line for change in by_seed(one.changes, 7)],
                         [change.line for change in by_seed(other.changes, 7)])


class Unseen(unittest.TestCase):
    def test_every_entry__names_a_change_that_is_possible(self):
        sources = {}
        for entry in unseen.read(HERE / "unseen.txt"):
            if entry.path not in sources:
                sources[entry.path] = Source(entry.path, (ROOT / entry.path).read_text())
            self.assertTrue(any(entry.matches(change) for change in sources[entry.path].changes), str(entry))


if __name__ == "__main__":
    unittest.main()
